"""``python -m remeshvec`` is the shell command."""

from .cli.command import main

raise SystemExit(main())
