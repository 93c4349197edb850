"""All bombs, by the gate that must hold them."""

from __future__ import annotations

from support.bombs.bags import BAGS
from support.bombs.files import FILES
from support.bombs.messages import HIDDEN_TEXTS, MESSAGES
from support.bombs.pages import PAGES
from support.bombs.texts import JSONS, YAMLS
from support.bombs.totals import TOTALS

BOMBS = (*FILES, *BAGS, *YAMLS, *JSONS, *MESSAGES, *HIDDEN_TEXTS, *TOTALS, *PAGES)
