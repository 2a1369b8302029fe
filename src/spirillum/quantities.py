"""The registry of quantities: name, symbol, units, meaning and source of everything that answers hold."""
