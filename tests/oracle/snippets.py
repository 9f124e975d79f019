"""Runs the Python of a document.

usage: snippets.py DOCUMENT FOLDER        prints JSON

Each ```python block of the Markdown DOCUMENT runs by itself in FOLDER. The result is a list of their
outputs.
"""

import contextlib
import io
import json
import os
import re
import sys


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[1], encoding="utf-8") as file:
        document = file.read()
    os.chdir(sys.argv[2])
    printed = []
    for block in re.findall(r"^```python\n(.*?)^```", document, re.MULTILINE | re.DOTALL):
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(block, {})
        printed.append(out.getvalue())
    print(json.dumps(printed))


if __name__ == "__main__":
    main()
