from pathlib import Path

from tests.jobs.kill_campaign import campaign


def test_nothing_acknowledged_is_lost_in_ten_kills(tmp_path: Path) -> None:
    report = campaign(tmp_path, 10, minutes=60.0)
    assert sum(report["kills"].values()) == 10
    assert report["jobs"] >= report["posted"] > 0
    again = campaign(tmp_path, 10, minutes=60.0)
    assert again == report
