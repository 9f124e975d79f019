"""Runs the queries of a document on DuckDB.

usage: fleet.py DOCUMENT FOLDER        prints JSON

Each ```sql block of the Markdown DOCUMENT is a query; they run in FOLDER, which has `fleet/`.
For each: the heading above it, its columns and its rows.
"""

import json
import os
import re
import sys

import duckdb


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[1], encoding="utf-8") as file:
        document = file.read()
    os.chdir(sys.argv[2])
    results, heading = [], ""
    connection = duckdb.connect()
    for found in re.finditer(r"^##+ ([^\n]+)$|^```sql\n(.*?)^```", document, re.MULTILINE | re.DOTALL):
        if found.group(1):
            heading = found.group(1)
            continue
        answer = connection.execute(found.group(2))
        columns = [column[0] for column in answer.description]
        results.append({"heading": heading, "columns": columns, "rows": answer.fetchall()})
    print(json.dumps(results, default=str))


if __name__ == "__main__":
    main()
