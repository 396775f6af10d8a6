"""Derived amounts (sums, counts, maxima and minima over individuals), compiled to ordinary conditions and effects.

A sum or a count becomes an amount in each state. The first value of the amount is calculated from the initial state
(`totals.py`), and each behaviour gets effects that update the amount (`keeping.py`). For example, let ``LOAD(cart)`` be the sum of
``weight(item)`` over all items in the cart. The behaviour PUT(?item, ?cart) then increases LOAD(?cart) by weight(?item) and
decreases LOAD of the item's previous cart.

A maximum or a minimum needs no effects. A condition that reads a maximum or minimum becomes a witness: an individual that no
other individual exceeds (`extrema.py`).
"""
