"""What every test stands on."""

import signal

# A shell ignores Ctrl-C in what it starts in the background, and Python keeps to that: the tests of interrupts, and
# the processes that they start, would wait for ever.
signal.signal(signal.SIGINT, signal.default_int_handler)
