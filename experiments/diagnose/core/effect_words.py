"""What the candidates are, what shows that one of them is really there, and which experiment separates two of them.

The words stand in the effects' own files (`rigid.terms`).
"""

from rigid.terms import find_candidate

__all__ = ["advice", "confirmation", "meaning", "push_advice"]


def meaning(effect: str) -> str:
    """One sentence on what the effect is; empty where its file does not say it."""
    found = find_candidate(effect)
    return f"{effect}: {found.meaning}." if found is not None else ""


def confirmation(effect: str) -> str:
    """One sentence: the trial or bench measurement that would show the effect by itself."""
    found = find_candidate(effect)
    otherwise = "change what is thought to cause it and repeat a trial: the effect should follow"
    return f"To confirm {effect}: {found.confirm if found is not None else otherwise}."


def advice(first: str, second: str) -> str:
    """One sentence: the measurements that separate two effects of tumbles."""
    known = [(id, _bench(id)) for id in (first, second)]
    if all(bench for _, bench in known):
        both = ", and ".join(f"{bench} ({id})" for id, bench in known)
        return f"To tell {first} from {second}: {both}."
    one = next((bench for _, bench in known if bench), "repeat the trials at another torque and gravity")
    return f"To tell {first} from {second}: {one}."


def _bench(effect: str) -> str:
    found = find_candidate(effect)
    return found.tumble.bench if found is not None and found.tumble is not None else ""


def push_advice(first: str, second: str) -> str:
    """One sentence: the push that separates two effects of penetration."""
    for one, other in ((first, second), (second, first)):
        found = find_candidate(one)
        if found is not None and found.push is not None and other in found.push.apart:
            return found.push.apart[other]
    return (
        f"Drive the spike in and out at two speeds a factor of ten apart, to twice the depth reached here: {first} and "
        f"{second} part where speed, direction and depth change one at a time."
    )
