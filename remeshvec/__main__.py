"""``python -m remeshvec`` is the shell command."""

from remeshvec.cli import main

raise SystemExit(main())
