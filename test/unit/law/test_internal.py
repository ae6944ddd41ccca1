"""The internal wrench: it moves nothing, its rest is the least load, and kappa is bounded by the delay."""

from __future__ import annotations

import numpy as np

from test.referees.law_referee import grasp_matrix_parts
from test.support.law_cases import Case, random_case


def of_contact(case: Case, i: int) -> Case:
    """Return the case as the arm of contact i sees it: that contact first, its pad where it is."""
    own, c, s = random_case(0, contacts=case.contacts), case.config, case.slips
    order = [i, *(k for k in range(case.contacts) if k != i)]
    R_o = case.arm.rotation @ (c.contact[0].rotation @ s[0].rotation).T
    places = [case.gains.contact_position, *(c.contact[k].position for k in range(1, case.contacts))]
    for at, k in enumerate(order):
        own.config.contact[at].rotation[:] = c.contact[k].rotation
        own.config.contact[at].position[:] = places[k]
        own.slips[at].position[:], own.slips[at].rotation[:] = s[k].position, s[k].rotation
        own.samples[at].wrench[:] = case.samples[k].wrench
    own.gains.contact_position[:] = places[i]
    own.config.radius = case.config.radius
    own.arm.rotation[:] = R_o @ c.contact[i].rotation @ s[i].rotation
    return own


def test_internal_wrenches_of_all_contacts_move_nothing() -> None:
    for seed in range(5):
        for contacts in (2, 3):
            case = random_case(seed, contacts=contacts)
            total = np.zeros(6)
            for i in range(contacts):
                own = of_contact(case, i)
                h = np.kron(np.eye(2), own.arm.rotation) @ own.evaluate().h_int
                R_o = own.arm.rotation @ (own.config.contact[0].rotation @ own.slips[0].rotation).T
                parts = grasp_matrix_parts(
                    R_o, own.gains.contact_position, own.config.contact[0].rotation, own.slips[0].position
                )
                total += sum(parts) @ h
            np.testing.assert_allclose(total, 0.0, atol=1e-12)


def test_pulling_along_the_line_of_two_pads_is_internal_and_a_common_load_is_not() -> None:
    case = random_case(1, contacts=2)
    for i, side in enumerate((1.0, -1.0)):
        case.config.contact[i].position[:] = 0.0, 0.18 * side, 0.0
        case.config.contact[i].rotation[:], case.slips[i].rotation[:] = np.eye(3), np.eye(3)
        case.slips[i].position[:], case.samples[i].wrench[:] = 0.0, 0.0
        case.samples[i].wrench[1] = 2.0 * side
    case.gains.contact_position[:] = case.config.contact[0].position
    np.testing.assert_allclose(case.evaluate().h_int, (0.0, 2.0, 0.0, 0.0, 0.0, 0.0), atol=1e-15)
    for i in range(2):
        case.samples[i].wrench[:] = 0.0, 2.0, 1.0, 0.0, 0.0, 0.0
    np.testing.assert_allclose(case.evaluate().h_int, 0.0, atol=1e-15)


def test_the_pad_gives_way_by_kappa_over_M_D_and_one_contact_has_nothing_internal() -> None:
    plain, giving = random_case(3, contacts=2), random_case(3, contacts=2, kappa=0.5)
    a, b = plain.evaluate(), giving.evaluate()
    expected = 0.5 * (np.kron(np.eye(2), giving.arm.rotation) @ b.h_int) / giving.gains.gains.M_D
    np.testing.assert_allclose(b.a_C - a.a_C, expected, atol=1e-12 * np.abs(b.a_C).max())
    assert not random_case(3, kappa=0.5).evaluate().h_int.any()
