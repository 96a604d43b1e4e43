"""What stands for well-known programs that are started by hand."""

from __future__ import annotations

import pytest

from deploy.launch.run_node import dynparam_verb
from services.runtime.errors import BadInput


def test_dynparam_is_a_verb_of_param() -> None:
    asked = {
        "list": "list",
        "get /arm": "get /arm",
        "set /arm Kp 3.5": "set /arm Kp 3.5",
        "load /arm gains.yaml": "load gains.yaml --set /arm",
        "dump /arm gains.yaml": "dump /arm --output gains.yaml",
    }
    assert {words: " ".join(dynparam_verb(words.split())) for words in asked} == asked
    assert dynparam_verb(["set", "/arm", "{Kp: 3.5, kind: sine}"]) == ["set", "/arm", "Kp=3.5", 'kind="sine"']
    for words, reason in ((["sett", "/arm"], "did you mean 'set'"), (["load"], "load NODE FILE"), ([], "set")):
        with pytest.raises(BadInput, match=reason):
            dynparam_verb(words)
