"""Derived amounts: a sum, a count, a maximum or a minimum over individuals, in terms of other conditions and effects.

A sum or a count becomes an amount that is part of each state. Its first value is calculated from the initial state (`totals.py`);
each behaviour gets the effects that keep it up to date (`keeping.py`). For ``LOAD(cart)``, the sum of ``weight(item)`` over all
items in the cart, PUT(?item, ?cart) increases LOAD(?cart) by weight(?item) and decreases LOAD of the cart that the item was in
before.

A maximum or a minimum needs no effects: a condition that reads it becomes a witness, an individual that no other one exceeds
(`extrema.py`).
"""
