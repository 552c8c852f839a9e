"""The public RO-Crate validator, without a network.

The validator reads one document from the web, the JSON-LD context that the crate names, through an
HTTP cache that its offline mode never looks beyond. Here the cache is filled by hand with
contexts/ro-crate-1.1.json: the few terms that our crates use, mapped as the published context maps
them. A term that is not in it is reported by the validator as undefined.
"""

from __future__ import annotations

import json
from pathlib import Path

CONTEXT = Path(__file__).parent / "contexts" / "ro-crate-1.1.json"
CONTEXT_URL = "https://w3id.org/ro/crate/1.1/context"


def _seed(cache: Path) -> None:
    """Store the context as if it had been downloaded."""
    from requests_cache import CachedSession
    from requests_cache.models import CachedRequest, CachedResponse

    response = CachedResponse(
        content=CONTEXT.read_bytes(),
        headers={"Content-Type": "application/ld+json"},
        request=CachedRequest(method="GET", url=CONTEXT_URL),
        status_code=200,
        url=CONTEXT_URL,
    )
    with CachedSession(str(cache), backend="sqlite") as session:
        session.cache.save_response(response)


def issues(folder: Path, cache: Path) -> list[str]:
    """What the validator has to say against `folder` as a Process Run Crate; empty if nothing.

    It is asked about all that the profile, and RO-Crate 1.1 beneath it, requires or recommends.
    `cache` is a path, outside `folder`, where the HTTP cache may be written.
    """
    from rocrate_validator.services import validate

    _seed(cache)
    result = validate(
        {
            "rocrate_uri": str(folder),
            "profile_identifier": "process-run-crate",
            "requirement_severity": "RECOMMENDED",
            "offline": True,
            "cache_path": cache,
        }
    )
    # A check that was skipped has found nothing, and proves nothing.
    skipped = [f"SKIPPED {s.check.identifier}: {s.message}" for s in result.skipped_check_details]
    found = [f"{i.severity.name} {i.check.identifier}: {i.message}" for i in result.get_issues()]
    return sorted(found) + skipped


def terms() -> dict[str, str]:
    """The seeded context."""
    context: dict[str, str] = json.loads(CONTEXT.read_text())["@context"]
    return context
