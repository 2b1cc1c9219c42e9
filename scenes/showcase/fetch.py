"""Fetches files of a scene, once, and checks that they are those that it was made with."""

import hashlib
import os
import sys
import urllib.request


def fetch(url, path, checksum):
    """Brings a file from a public address to a path, unless it is there. Ends the program if its SHA-256 is another."""
    if not os.path.exists(path):
        print("fetching", url)
        try:
            with urllib.request.urlopen(url, timeout=60) as answer:
                data = answer.read()
        except OSError as error:
            sys.exit("%s can't be fetched: %s\nwith a connection to the net run this again, or put that file at %s" % (url, error, path))
        with open(path, "wb") as file:
            file.write(data)
    with open(path, "rb") as file:
        if hashlib.sha256(file.read()).hexdigest() != checksum:
            sys.exit("%s is not the file that this scene was made with: delete it and try again" % path)
