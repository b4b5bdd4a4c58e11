"""Close codes: the same in code, in docs/protocol.md and in the link's refusals."""

import re
from pathlib import Path

from robot.link import REFUSALS
from robot.wire.close_codes import FINAL_FOR_PAGES, CloseCode

PROTOCOL = Path(__file__).parents[3] / "docs" / "protocol.md"


def test_the_protocol_documents_each_code():
    documented = re.findall(r"^\| (4\d{3}) \|", PROTOCOL.read_text("utf-8"), re.MULTILINE)
    assert sorted(map(int, documented)) == sorted(CloseCode)


def test_of_refusals_a_page_waits_only_for_another_device_to_leave():
    assert REFUSALS.keys() - FINAL_FOR_PAGES == {CloseCode.BUSY}
    assert REFUSALS.keys() >= FINAL_FOR_PAGES
    assert CloseCode.ELSEWHERE not in REFUSALS  # never final
