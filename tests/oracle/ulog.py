"""Compares every field of a ULog between hums and pyulog.

Usage: ulog.py LOG.ulg[.gz] FOLDER. FOLDER has the reading of hums: tables.json, and for each table NAME.bin, eight bytes a
value, row by row (unsigned and signed integers, flags, bits of float and double; text as zero)."""

import gzip
import io
import json
import sys
from pathlib import Path

import numpy as np
from pyulog import ULog


def bits(column):
    """Eight bytes a value, as hums wrote them."""
    if column.dtype == np.float32:
        return column.view(np.uint32).astype(np.uint64)
    if column.dtype == np.float64:
        return column.view(np.uint64)
    return column.astype(np.int64).view(np.uint64) if column.dtype.kind == "i" else column.astype(np.uint64)


def main():
    log, folder = Path(sys.argv[1]), Path(sys.argv[2])
    data = log.read_bytes()
    if log.suffix == ".gz":
        data = gzip.decompress(data)
    ulog = ULog(io.BytesIO(data))
    tables = json.loads((folder / "tables.json").read_text())
    result = {"topics": 0, "values": 0, "wrong": [], "parameters": 0, "texts": 0}
    for dataset in ulog.data_list:
        columns = tables.get(dataset.name)
        if columns is None:
            if len(dataset.data["timestamp"]):
                result["wrong"].append(f"{dataset.name}: no table")
            continue
        rows = np.fromfile(folder / f"{dataset.name}.bin", dtype=np.uint64).reshape(-1, len(columns))
        rows = rows[rows[:, 0] == dataset.multi_id]
        names = set(columns[1:])
        result["topics"] += 1
        for field in dataset.field_data:
            name = field.field_name
            # By the format padding is not shown; pyulog shows that of nested definitions.
            if field.type_str == "char" or "_padding" in name:
                continue
            if name not in names:
                result["wrong"].append(f"{dataset.name}: no {name}")
                continue
            # A flag that was never set may have any bits in the log.
            flag = field.type_str == "bool"
            expected = (dataset.data[name] != 0).astype(np.uint64) if flag else bits(dataset.data[name])
            got = rows[:, columns.index(name)]
            result["values"] += len(expected)
            if len(got) != len(expected) or not np.array_equal(got, expected):
                result["wrong"].append(f"{dataset.name}.{name} of {dataset.multi_id}: {len(got)} of {len(expected)}")
    ours = json.loads((folder / "rest.json").read_text())
    parameters = {name: float(value) for name, value in ulog.initial_parameters.items()}
    parameters.update({name: float(value) for _, name, value in ulog.changed_parameters})
    result["parameters"] = len(parameters)
    if parameters != ours["parameters"]:
        result["wrong"].append("parameters")
    texts = [message.message for message in ulog.logged_messages]
    texts += [message.message for tagged in ulog.logged_messages_tagged.values() for message in tagged]
    result["texts"] = len(texts)
    if sorted(texts) != sorted(ours["texts"]):
        result["wrong"].append("texts")
    dropouts = [dropout.duration for dropout in ulog.dropouts]
    if dropouts != ours["dropouts"]:
        result["wrong"].append(f"dropouts: {ours['dropouts']} instead of {dropouts}")
    print(json.dumps(result))


main()
