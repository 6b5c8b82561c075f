"""Effects at the contact with the ground: one file an effect. They import nothing but leaves of `rigid.terms`."""
