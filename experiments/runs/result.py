"""The result of a run, which `rigid.result` has; result.schema.json beside this file is its JSON schema.

``python -m experiments.runs.result`` prints the schema.
"""

from rigid.result import Departures, Quantity, Result, Table, quantities_of, quantity, schema
from rigid.series import Series

__all__ = ["Departures", "Quantity", "Result", "Series", "Table", "quantities_of", "quantity", "schema"]

if __name__ == "__main__":
    print(schema(), end="")
