"""The symbols of an arm's cycle, for topics and pages."""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import IN1, OUT1, VOID, kernel
from slip_core.records import record
from slip_vic_controller.law.symbols import SYMBOLS, no_symbols, symbols
from slip_vic_controller.state import CONFIG, INPUTS, OUTPUTS


@kernel(VOID, IN1, IN1, IN1, OUT1)
def fill_symbols(config_buffer: Array, inputs_buffer: Array, outputs_buffer: Array, symbols_buffer: Array) -> None:
    """Fill the SYMBOLS of an arm's cycle, when something looks at them.

    Args:
        config_buffer, inputs_buffer, outputs_buffer: CONFIG, INPUTS, OUTPUTS of the arm, after `cycle`.
        symbols_buffer: SYMBOLS.
    """
    config, out = record(config_buffer, CONFIG), record(symbols_buffer, SYMBOLS)
    inputs, outputs = record(inputs_buffer, INPUTS), record(outputs_buffer, OUTPUTS)
    no_symbols(outputs.effort, outputs.saturated, symbols_buffer)
    if outputs.ok != 0:
        law, sliding = outputs.law, outputs.sliding
        symbols(config.law, outputs.gains, inputs.arm, outputs.slips, outputs.reference, law, sliding, out)
        for j in range(config.law.joints):
            out.effort[j], out.saturated[j] = outputs.effort[j], outputs.saturated[j]
