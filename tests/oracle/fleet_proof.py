"""Runs the queries of a document on a large fleet, with times and files read.

usage: fleet_proof.py DOCUMENT FOLDER [--spark]        prints JSON

FOLDER has `fleet/` and `expected.json` (sessions and frames of recordings). Queries of the table `sessions` run as they are. The
others run for one vehicle and day, by a condition on the partitions: the number of files that the engine reads shows the
pruning. With --spark the queries of `sessions` run in Spark too, if pyspark and Java are there.
"""

import datetime
import glob
import json
import os
import re
import sys
import time

import duckdb

TABLE = re.compile(r"read_parquet\('fleet/(\w+)/\*/\*/\*\.parquet', hive_partitioning = true, union_by_name = true\)")


def queries(document):
    heading = ""
    for found in re.finditer(r"^##+ ([^\n]+)$|^```sql\n(.*?)^```", document, re.MULTILINE | re.DOTALL):
        if found.group(1):
            heading = found.group(1)
        else:
            yield heading, found.group(2).strip().rstrip(";")


def plain(rows):
    """Rows of any engine in one form and order."""

    def cell(value):
        if isinstance(value, datetime.date):
            return value.isoformat()[:10]
        return round(float(value), 2) if hasattr(value, "__float__") else value

    return sorted(json.dumps([cell(value) for value in row], default=str) for row in rows)


def duck(document, connection, one):
    for heading, query in queries(document):
        (table,) = set(TABLE.findall(query))
        is_summary = table == "sessions"
        if not is_summary:
            vehicle, date, bucket = one
            query = re.sub(r"system-1-[\w-]+", vehicle, query)
            query = re.sub(r"date >= DATE '[^']+'", f"date = DATE '{date}'", query)
            where = f"WHERE date = DATE '{date}' AND bucket = {bucket} AND vehicle = '{vehicle}'"
            query = TABLE.sub(lambda found: f"(SELECT * FROM {found.group(0)} {where})", query)
        begun = time.monotonic()
        rows = connection.execute(query).fetchall()
        answer = {"heading": heading, "seconds": time.monotonic() - begun, "rows": len(rows)}
        if not is_summary:
            plan = connection.execute("EXPLAIN ANALYZE " + query).fetchall()[0][1]
            answer["files_read"] = int(re.search(r"Total Files Read: (\d+)", plan).group(1))
            answer["files"] = len(glob.glob(f"fleet/{table}/*/*/*.parquet"))
        yield answer, query, rows


def spark(asked, one):
    try:
        from pyspark.errors import AnalysisException
        from pyspark.sql import SparkSession
    except ImportError:
        return "pyspark is not installed"
    try:
        session = (
            SparkSession.builder.master("local[2]")
            .config("spark.ui.enabled", "false")
            .config("spark.sql.session.timeZone", "UTC")
            # So that its plan is there before it runs, with the number of files.
            .config("spark.sql.adaptive.enabled", "false")
            .getOrCreate()
        )
    except Exception as error:
        return f"it does not start: {error}"
    session.sparkContext.setLogLevel("OFF")
    for table in ["sessions", "ATTITUDE"]:
        frame = session.read.option("mergeSchema", "true").parquet(f"fleet/{table}")
        frame.createOrReplaceTempView(table)
    same, different = 0, []
    for heading, query, rows in asked:
        try:
            plan = session.sql(TABLE.sub(r"\1", query))
        except AnalysisException:
            different.append(heading)
            continue
        answer = plan.collect()
        if plain(answer) != plain(rows):
            sys.exit(f"Spark answers {heading} with {plain(answer)[:3]}, DuckDB with {plain(rows)[:3]}")
        same += 1
    vehicle, date, bucket = one
    all_files = len(session.sql("SELECT roll FROM ATTITUDE").inputFiles())
    some = f"SELECT max(roll) FROM ATTITUDE WHERE date = DATE '{date}' AND bucket = {bucket} AND vehicle = '{vehicle}'"
    execution = session.sql(some)
    execution.collect()
    plan = execution._jdf.queryExecution().executedPlan()
    read = re.search(r"PartitionFilters: \[([^\]]*)\]", plan.toString())
    if not read or "date" not in read.group(1) or "bucket" not in read.group(1):
        sys.exit(f"Spark does not prune: {plan.toString()[:2000]}")
    leaf = plan.collectLeaves().head()
    return {
        "version": session.version,
        "queries": len(asked),
        "same": same,
        "other": different,
        "files_read": leaf.metrics().apply("numFiles").value(),
        "files": all_files,
    }


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    with open(sys.argv[1], encoding="utf-8") as file:
        document = file.read()
    os.chdir(sys.argv[2])
    with open("expected.json", encoding="utf-8") as file:
        expected = json.load(file)
    connection = duckdb.connect()
    table = "read_parquet('fleet/sessions/*/*/*.parquet', hive_partitioning = true, union_by_name = true)"
    of_recordings = f"FROM {table} WHERE box_version IS NULL"
    found = connection.execute(f"SELECT count(*), count(DISTINCT session), sum(frames)::BIGINT {of_recordings}").fetchall()[0]
    if found != (expected["sessions"], expected["sessions"], expected["frames"]):
        sys.exit(f"sessions, different ones, frames: {found}, expected {expected}")
    first = "SELECT vehicle, date, bucket::INTEGER"
    one = connection.execute(f"{first} {of_recordings} ORDER BY vehicle, date LIMIT 1").fetchall()[0]
    asked = list(duck(document, connection, one))
    result = {"queries": [answer for answer, _, _ in asked], "spark": "not asked for"}
    if "--spark" in sys.argv:
        summary = [(answer["heading"], query, rows) for answer, query, rows in asked if "files" not in answer]
        try:
            result["spark"] = spark(summary, one)
        except Exception as error:
            # snappy-java takes its library for musl wherever musl is installed.
            if "UnsatisfiedLinkError" not in str(error):
                raise
            result["spark"] = "its library for Snappy does not load; remove the packages musl and musl-tools"
    print(json.dumps(result))


if __name__ == "__main__":
    main()
