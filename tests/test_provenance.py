import json

from app.provenance import describe


def test_description_names_processor_cores_and_versions_as_json() -> None:
    told = json.loads(json.dumps(describe()))
    assert told["cpu"] and told["cores"] >= 1
    assert {"numpy", "torch", "pin"} <= told["packages"].keys()
