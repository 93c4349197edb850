# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Languages of the screens: English, and every file of texts in config/languages."""

from __future__ import annotations

import re
from string import Formatter

from flea_diag.configuration.files import config_folders, config_path, is_bare, load_yaml
from flea_diag.errors import ConfigurationError, shown
from flea_diag.formats import migrated

ENGLISH = "en"
FOLDER = "languages"
SUFFIX = ".yaml"
KIND = "language"
CODE = re.compile("[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})?")
"""As ``lang`` of HTML has it: de, pt-BR."""


def languages() -> tuple[str, ...]:
    """Codes of the languages that are shipped."""
    found = {p.stem for folder in config_folders() for p in (folder / FOLDER).glob(f"*{SUFFIX}")}
    return (ENGLISH, *sorted(found))


def catalogue(name: str) -> tuple[str, dict[str, str]]:
    """Code and texts, by their English, of a language: of a shipped one by its code, or of a file.

    Raises
    ------
    ConfigurationError
        There is none of this name, or the file is no catalogue of texts.
    """
    if name == ENGLISH:
        return ENGLISH, {}
    if is_bare(name) and name not in languages():
        raise ConfigurationError(
            f"language = {shown(name)}: there is none of this name; take one of "
            f"{', '.join(languages())}, or the path of a file of texts"
        )
    place = str(config_path(f"{FOLDER}/{name}{SUFFIX}")) if is_bare(name) else name
    content = migrated(KIND, load_yaml(place), place)
    code, texts = content.get("code"), content.get("texts")
    if not (isinstance(code, str) and CODE.fullmatch(code) and isinstance(texts, list)):
        raise ConfigurationError(
            f"{place}: a language has a code, such as 'de', and a list of texts"
        )
    return code, dict(_pair(entry, code, place) for entry in texts)


def _pair(entry: object, code: str, place: str) -> tuple[str, str]:
    """English and the other language of one entry, whose places in braces are the same."""
    if isinstance(entry, dict):
        text, said = entry.get(ENGLISH), entry.get(code)
        if isinstance(text, str) and isinstance(said, str) and len(entry) == 2:
            if places(text) != places(said):
                raise ConfigurationError(
                    f"{place}: {shown(said)} must have the places in braces of {shown(text)}"
                )
            return text, said
    raise ConfigurationError(f"{place}: {shown(entry)} is no text: each has {ENGLISH} and {code}")


def places(text: str) -> frozenset[str]:
    """What stands in braces, such as ``{count}`` or ``{rate:.2g}``.

    Raises
    ------
    ConfigurationError
        A brace that opens nothing or stays open.
    """
    try:
        found = [(name, spec) for _, name, spec, _ in Formatter().parse(text) if name is not None]
    except ValueError as error:
        raise ConfigurationError(f"{shown(text)}: {error}") from None
    return frozenset(f"{name}:{spec}" for name, spec in found)
