import json

from app.provenance import describe


def test_description_names_processor_cores_and_versions_as_json() -> None:
    found = json.loads(json.dumps(describe()))
    assert found["cpu"] and found["cores"] >= 1
    assert {"numpy", "torch", "pin"} <= found["packages"].keys()
