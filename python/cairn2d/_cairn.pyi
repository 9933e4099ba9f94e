"""The extension module: libcairn and its host library as cffi sees them."""

from typing import Any

ffi: Any
lib: Any
