"""
The method itself, as pure functions of arrays: no I/O, clock, logging, settings or globals.

Where to find what, in the order in which data flows; each line begins where reading begins:

- On the ground: geodesy, lines, neighbourhoods, graph.
- Drives before they are passes: drive_quality, ground, tally, smoothing; `network` finds roads.
- Passes to a road's model: roadfit, centreline, passes, wild, registration, joint, left_out,
  fitting, curves, hearing.
- Sub-segments and salient features: segmentation, subsegments, features, salience, selection.
- What surveys are worth: coverage, expectation, advice.
- The observation model: observation, offsets, carriers, listing, elsewhere, this_road, offmap.
- The map in memory: index, tapes, blocks, acquaintance, days, newcomers, surroundings, salient,
  turns.
- A window against it: matching, query, coarse, chosen, stretches, alignment, refinement; round
  corners: corners, ways, paths; its odometer: odometer, odometer_prior. The definition: exhaustive.
- The answer: posterior, answer, summary, spread.
- One vehicle's windows in a row: tracking, belief, motion, carried.
- Why: explanation, rivals, contributions, expected, heeded, wording.
- How far probabilities hold: calibration, heldout, evidence_table, independence, unseen, trials,
  odds, reliability.
- The same in C: `kernels`; native says whether they are there, native_chosen, native_factors,
  native_gains, native_laws, native_readings and native_summary call them.
"""
