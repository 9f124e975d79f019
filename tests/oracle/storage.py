"""Another client of object storage: pyarrow's, with DuckDB for the queries of a document.

usage: storage.py make BUCKET               makes a bucket
       storage.py list BUCKET/PREFIX        prints the keys below it, as JSON
       storage.py query BUCKET/PREFIX DOCUMENT    prints JSON

Server and credentials are those of the environment (AWS_ENDPOINT_URL and others). `query` runs each ```sql block of the
Markdown DOCUMENT on the tables below the prefix; `read_parquet('fleet/TABLE/...')` is the table there. For each: the heading
above it, and its rows.
"""

import json
import os
import re
import sys

import duckdb
import pyarrow
import pyarrow.dataset
from pyarrow import fs

import fleet_proof


def client():
    return fs.S3FileSystem(
        access_key=os.environ["AWS_ACCESS_KEY_ID"],
        secret_key=os.environ["AWS_SECRET_ACCESS_KEY"],
        endpoint_override=os.environ["AWS_ENDPOINT_URL"],
        allow_bucket_creation=True,
    )


def table(storage, folder):
    partitions = pyarrow.dataset.partitioning(
        pyarrow.schema([("date", pyarrow.date32()), ("bucket", pyarrow.int32())]), flavor="hive"
    )
    # As union_by_name: a column of any file is a column of the table.
    all_files = pyarrow.dataset.dataset(folder, filesystem=storage, partitioning=partitions)
    schemas = [fragment.physical_schema for fragment in all_files.get_fragments()]
    schema = pyarrow.unify_schemas([*schemas, partitions.schema], promote_options="permissive")
    return pyarrow.dataset.dataset(folder, schema=schema, filesystem=storage, partitioning=partitions)


def query(storage, folder, document):
    connection, answers = duckdb.connect(), []
    for heading, text in fleet_proof.queries(document):
        for name in set(fleet_proof.TABLE.findall(text)):
            connection.register(f"table_{name}", table(storage, f"{folder}/{name}"))
        rows = connection.execute(fleet_proof.TABLE.sub(r"table_\1", text)).fetchall()
        # JSON has no NaN.
        rows = [[None if cell != cell else cell for cell in row] for row in rows]
        answers.append({"heading": heading, "rows": rows})
    return answers


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    what, place, storage = sys.argv[1], sys.argv[2], client()
    if what == "make":
        storage.create_dir(place)
        result = place
    elif what == "list":
        found = storage.get_file_info(fs.FileSelector(place, recursive=True, allow_not_found=True))
        result = sorted(info.path[len(place) + 1 :] for info in found if info.is_file)
    else:
        with open(sys.argv[3], encoding="utf-8") as file:
            result = query(storage, place, file.read())
    print(json.dumps(result, default=str))


if __name__ == "__main__":
    main()
