"""The lock lists every installed package, with hashes, and without host names."""

from __future__ import annotations

import re
import tomllib

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from deploy import VERSION
from services.runtime.process import ROOT
from tests.harness.project_files import project_files

ENTRY = re.compile(r"^([\w.-]+)==(\S+)(?: ; [^\\]+)? \\\n((?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)", re.MULTILINE)
LOCK = (ROOT / "requirements.lock").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())

HOSTS = re.compile(r"p[y]pi\.org|p[y]thonhosted\.org|c[r]ates\.io|n[p]mjs\.(?:com|org)|a[n]aconda\.(?:com|org)")
"""Hosts of package registries; a lock that names one would defeat mirrors."""


def test_every_package_is_pinned_with_hashes_and_nothing_else_is_stated() -> None:
    assert ENTRY.sub("", LOCK).strip() == ""
    assert len(ENTRY.findall(LOCK)) > 40


def test_the_lock_serves_what_the_project_asks_for() -> None:
    pinned = {canonicalize_name(name): version for name, version, _ in ENTRY.findall(LOCK)}
    asked = [*PROJECT["project"]["dependencies"], *PROJECT["dependency-groups"]["dev"]]
    for text in asked:
        wanted = Requirement(text)
        assert wanted.specifier.contains(pinned[canonicalize_name(wanted.name)]), text


def test_no_file_names_the_host_of_a_registry() -> None:
    found = []
    for path in project_files():
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        found += [f"{path}: {host}" for host in HOSTS.findall(text)]
    assert found == []


def test_one_version_everywhere() -> None:
    assert PROJECT["project"]["version"] == VERSION
    assert f"## [{VERSION}]" in (ROOT / "CHANGELOG.md").read_text()
