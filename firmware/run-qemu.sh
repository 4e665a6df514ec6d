#!/usr/bin/env bash
# run-qemu.sh IMAGE: runs a firmware image under emulation; exits with the image's status.
# BOARD chooses the emulated board: mps2-an386 (Cortex-M4F, the default) or mps2-an500 (Cortex-M7).
# With shift=6 every instruction takes 64 ns of virtual time, which makes counts repeatable.
set -euo pipefail
exec timeout "${QEMU_TIMEOUT:-120}" qemu-system-arm -M "${BOARD:-mps2-an386}" -icount shift=6 \
    -nic user,restrict=on -display none -monitor none -serial none -semihosting-config enable=on,target=native -kernel "$1"
