"""Starts a page in one network and fetches it from another one."""

import re
import subprocess
import sys
from collections.abc import Sequence
from urllib.parse import urlsplit

from tests.networks import Networks
from tests.release.base import CheckFailedError

FETCH = """
import sys, urllib.error, urllib.request
for address in sys.argv[1:]:
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())  # the link sets a cookie
    try:
        with browser.open(address, timeout=60.0) as answer:
            print(answer.status, "<title>Monochord" in answer.read().decode())
    except urllib.error.HTTPError as error:
        print(error.code, False)
"""


def fetched(networks: Networks, command: Sequence[str]) -> tuple[str, str]:
    """Return status, and whether it is Monochord's page, of the printed link and of it without its token.

    The command runs in the near network, where it prints the link of its page; it is ended afterwards.
    """
    pipe, out = subprocess.PIPE, subprocess.STDOUT
    with subprocess.Popen([*networks.near, *command], stdout=pipe, stderr=out, text=True) as process:
        assert process.stdout
        try:
            printed: list[str] = []
            for line in process.stdout:
                printed.append(line)
                if link := re.search(r"http://\S+token=\S+", line):
                    break
            else:
                raise CheckFailedError(f"no page was served: {''.join(printed[-5:])}")
            parts = urlsplit(link[0])
            there = parts._replace(netloc=f"{networks.address}:{parts.port}")
            addresses = there.geturl(), there._replace(query="").geturl()
            fetch = [*networks.far, sys.executable, "-I", "-c", FETCH, *addresses]
            answers = subprocess.run(fetch, capture_output=True, text=True, check=False)
        finally:
            process.terminate()
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:  # unshare ignores the signal, and takes its child along
                process.kill()
        if answers.returncode:
            raise CheckFailedError(f"the page was not fetched: {answers.stderr[-500:]}")
    with_token, without = answers.stdout.splitlines()
    return with_token, without
