"""Metadata of the package that follow from the address at which its sources are published.

An index of packages shows the readme alone, without the files that it names: links and pictures need whole addresses
there. Whoever builds a release tells it, ``GEARFE_URL=https://... python -m build``; without it, links are those of the
repository.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface


class Addresses(MetadataHookInterface):
    """Called by hatchling (``[tool.hatch.metadata.hooks.custom]``)."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set readme and addresses of the project."""
        url = os.environ.get("GEARFE_URL", "").rstrip("/")
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        if url:
            pages = {"Source": "", "Documentation": "docs/index.md", "Changelog": "CHANGELOG.md"}
            metadata["urls"] = {name: f"{url}/blob/HEAD/{page}" if page else url for name, page in pages.items()}
            text = re.sub(r"(!\[[^]]*\]\()(?!https?:|#)", rf"\g<1>{url}/raw/HEAD/", text)
            text = re.sub(r"((?<!!)\[[^]]*\]\()(?!https?:|#)", rf"\g<1>{url}/blob/HEAD/", text)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
