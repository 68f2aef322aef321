"""``python -m remeshvec`` is the shell command."""

from .cli import main

raise SystemExit(main())
