"""Edits in rooms of the library and of the problems, and tests that fail with each.

The edit lets a function raise an error. The tests are the nearest one that was seen to run the
function, and the farthest ones, each with its file below `tests/`.
"""

import ast

FAILING = """
problems/bench/records/reading.py _columns
    problems/bench/test_public_records.py
        test_text_csv_and_matlab_files_are_halved_or_come_in_halves
    problems/bench/test_public_records.py
        test_a_package_is_judged_on_the_second_half_alone
problems/cd_drive/control/control_problem.py optical_gain
    problems/cd_drive/control/test_control_problem.py
        test_delta_perturbs_the_plant_as_the_model_says
    problems/cd_drive/diagnosis/test_residual_index.py
        test_the_certificate_holds_and_there_is_a_figure
    problems/cd_drive/tolerance/test_switching_checks.py
        test_cells_that_are_missing_overlap_or_lie_outside
problems/cd_drive/diagnosis/position_estimator/model.py model
    problems/cd_drive/diagnosis/test_position_estimator.py
        test_model_is_the_laboratory_without_delay
    problems/cd_drive/diagnosis/test_position_estimator.py
        test_study_holds
    problems/cd_drive/tolerance/test_excursion.py
        test_the_map_is_certified
problems/cd_drive/drive/tables.py nominal_table
    problems/cd_drive/control/test_ageing.py
        test_models_hold_their_members
    problems/cd_drive/control/test_sensitivity.py
        test_what_is_wrong_is_found
    problems/cd_drive/diagnosis/test_disturbance_groups.py
        test_study
problems/cd_drive/laboratory/bench_setup.py find_drive
    problems/cd_drive/diagnosis/test_disturbance_groups.py
        test_a_jump_of_the_carriage_ends_as_the_spring_pulls
    problems/cd_drive/tolerance/test_switched_pair.py
        test_the_checks_can_fail
    problems/cd_drive/diagnosis/test_disturbance_groups.py
        test_study
problems/cd_drive/tolerance/playability/runs.py scored
    problems/cd_drive/tolerance/test_playability.py
        test_a_loss_is_counted_once_until_it_is_over
    problems/cd_drive/tolerance/test_switched_pair.py
        test_the_checks_can_fail
    problems/cd_drive/tolerance/test_playability.py
        test_a_corner_changes_what_a_player_does
problems/cd_drive/uncertainty/parametric_model.py two_masses
    uncertainty/test_parametric.py
        test_a_mass_that_may_vanish
    problems/cd_drive/tolerance/test_switching_checks.py
        test_cells_that_are_missing_overlap_or_lie_outside
    problems/cd_drive/tolerance/test_bandwidth_trade_off.py
        test_the_disc_leaves_what_the_sensitivity_says
problems/mass_spring/plant.py weights
    problems/mass_spring/test_plant.py
        test_the_spring_goes_from_1_2_to_2_8
    problems/quick/test_quick.py
        test_the_bounds_of_mu_enclose_it
    problems/mass_spring/test_analysis.py
        test_a_mixed_bound_above_the_complex_one_is_found
problems/textbook/distillation.py distillation_column
    problems/textbook/test_controller.py
        test_the_column_is_that_of_the_literature
    problems/quick/test_quick.py
        test_mu_of_the_column_is_that_of_the_literature
    problems/bench/test_synthesis_speed.py
        test_the_small_one_holds
workbench/bench/formats/netcdf.py _join
    fitting/test_response_fit.py
        test_dataset_round_trip
    figures/test_printed_figure.py
        test_the_page_of_the_pdf_has_the_width_that_was_asked_for
    problems/cd_drive/control/test_sensitivity.py
        test_the_weight_is_met_and_the_red_book_is_not
workbench/bench/comparison/verdicts.py judged
    bench/comparison/test_comparison_figures.py
        test_a_wrong_claim_is_crossed
    conic/test_stored_proofs.py
        test_in_a_comparison_only_what_is_proven_counts
    bench/comparison/test_comparison_files.py
        test_a_csv_file_has_a_row_for_every_cell
workbench/certify/rounding.py amplified
    certify/test_partial_fractions.py
        test_it_holds_for_any_eigenvectors_and_inverse
    synthesis/test_reduction.py
        test_bad_input_is_named
    mu/test_gain_room.py
        test_edges_are_where_the_closed_form_crosses_one
workbench/certify/modes/real_eigenvalues.py real_pencil
    certify/test_real_eigenvalues.py
        test_blocks_are_eliminated_as_by_complex_products
    problems/cd_drive/tolerance/test_lower_bandwidth.py
        test_defects_move_the_lens_less
    problems/cd_drive/tolerance/test_playability.py
        test_unknown_names_are_refused
workbench/conic/numeric.py _largest
    conic/test_no_solution.py
        test_a_solvable_program_has_an_exact_bound
    uncertainty/test_matrix_covers.py
        test_an_answer_comes_back_from_its_dataset_and_has_figures
    collections/test_cbf.py
        test_a_mixed_program_is_that_which_cvxpy_states
workbench/diagnosis/estimators/observers.py balanced_matrix
    diagnosis/test_disturbance_estimator.py
        test_models_that_are_none
    problems/cd_drive/tolerance/test_excursion.py
        test_the_map_is_certified
    problems/cd_drive/tolerance/test_strategies.py
        test_draws_are_independent_and_strategies_share_them
workbench/diagnosis/generators/generator.py realised
    diagnosis/test_model_matching.py
        test_a_published_model_with_two_faults_and_noise
    problems/cd_drive/diagnosis/test_exact_residuals_problem.py
        test_the_certificate_holds_and_there_is_a_figure
    problems/textbook/test_fault_detection.py
        test_it_is_certified_and_agrees_with_the_literature
workbench/figures/styles.py current_style
    figures/test_printed_figure.py
        test_letters_lines_and_titles_are_those_of_a_paper
    geometry/test_figures.py
        test_axes_are_labelled_with_units
    problems/cd_drive/uncertainty/test_cover_problems.py
        test_a_run_is_stored_and_shown
workbench/fitting/magnitude/gain.py target_of
    fitting/test_magnitude.py
        test_a_cover_has_the_shape_of_the_fit_where_the_data_are_dense
    uncertainty/test_covers.py
        test_every_array_has_a_unit_and_a_name
    uncertainty/test_conic_covers.py
        test_of_additive_circles_no_numerator_has_smaller_sets
workbench/fitting/response/vector_fitting.py spread_poles
    fitting/test_interior_point.py
        test_an_extreme_optimum_gives_way_to_one_that_doubles_realise
    uncertainty/test_covers.py
        test_every_array_has_a_unit_and_a_name
    uncertainty/test_conic_covers.py
        test_of_additive_circles_no_numerator_has_smaller_sets
workbench/geometry/area/program.py each_hull
    geometry/area/test_smallest_area.py
        test_it_is_offered_beside_the_narrowest
    geometry/area/test_evolution.py
        test_another_seed_searches_elsewhere_and_ends_at_the_same_area
workbench/identification/responses/assumptions.py assess
    problems/cd_drive/control/test_measured_sensitivity.py
        test_without_noise_the_sensitivity_of_the_sampled_loop_is_measured
    uncertainty/test_measured_responses.py
        test_files_give_responses_with_names_units_and_what_was_found_out
    problems/cd_drive/laboratory/test_closed_loop.py
        test_draws_differ_in_what_is_told
workbench/mu/boxes/partition.py effects_in
    mu/test_probability.py
        test_a_probability_known_in_closed_form
    mu/test_members.py
        test_bundles_of_sampled_and_of_unstable_systems
    mu/test_boxes.py
        test_a_damping_ratio
workbench/mu/frequency/sweep.py fitting
    mu/test_peak_sweep.py
        test_a_narrow_peak_between_wide_ones
    mu/test_members.py
        test_bundles
    problems/cd_drive/tolerance/test_lower_bandwidth.py
        test_its_certificate_holds
workbench/mu/lower/attain.py block_table
    mu/test_lower_search.py
        test_a_followed_eigenvalue_converges_cubically
    mu/test_members.py
        test_bundles
    problems/cd_drive/tolerance/test_lower_bandwidth.py
        test_its_certificate_holds
workbench/optics/layers.py _fields
    problems/cd_drive/drive/test_radial_error.py
        test_phase_detection_stands_displaced_light_at_a_quarter_wavelength
    optics/test_layers.py
        test_a_groove_sends_back_what_its_orders_say
workbench/second_opinion/responses.py plain_response
    second_opinion/test_loops_of_many_states.py
        test_responses_by_substitution_are_those_by_elimination
    problems/textbook/test_fault_detection.py
        test_it_is_certified_and_agrees_with_the_literature
    problems/textbook/test_experiment_times.py
        test_a_limit_of_each_line_spreads_the_power
workbench/simulation/cascade.py _place
    problems/cd_drive/tolerance/test_strategies.py
        test_speed
    problems/cd_drive/tolerance/test_switched_pair.py
        test_the_checks_can_fail
    problems/cd_drive/diagnosis/test_disturbance_groups.py
        test_study
workbench/starter/first_choices.py _phase
    starter/test_poor_records.py
        test_the_file_with_exchanged_columns_is_named
    starter/test_first_choices.py
        test_a_zero_right_of_the_axis_limits_it
workbench/study/checks.py _worst
    problems/cd_drive/diagnosis/test_raised_sum.py
        test_study
    problems/cd_drive/control/test_gain_room_problem.py
        test_a_wrong_edge_is_rejected
    figures/test_printed_figure.py
        test_the_page_of_the_pdf_has_the_width_that_was_asked_for
workbench/synthesis/h_infinity/normalised.py normalised_plant
    synthesis/test_hinf.py
        test_forty_states
    problems/textbook/test_fault_detection.py
        test_it_is_certified_and_agrees_with_the_literature
    diagnosis/test_fault_estimation.py
        test_a_claim_too_good_is_found_out
workbench/synthesis/implementation/discretise.py block_diagonal
    problems/cd_drive/tolerance/test_switching_stability.py
        test_figure_8_10
    problems/cd_drive/tolerance/test_switching_checks.py
        test_cells_that_are_missing_overlap_or_lie_outside
    problems/cd_drive/tolerance/test_lower_bandwidth.py
        test_its_certificate_holds
workbench/synthesis/switching/modes.py transitions
    problems/cd_drive/tolerance/test_switching_stability.py
        test_bounds_hold_for_random_defects
    problems/cd_drive/tolerance/test_switching_stability.py
        test_a_dwell_is_proven_where_any_switching_is_not
    synthesis/test_switching_loops.py
        test_stable_modes_are_proven_for_any_switching
workbench/systems/balancing.py balancing
    certify/test_sampled_sets.py
        test_a_claim_that_cannot_be_closed_is_an_error
    problems/cd_drive/control/test_sensitivity.py
        test_the_weight_is_met_and_the_red_book_is_not
    problems/cd_drive/diagnosis/test_exact_residuals_problem.py
        test_the_certificate_holds_and_there_is_a_figure
workbench/uncertainty/algebra/lft.py lift
    uncertainty/test_lft.py
        test_algebra_is_arithmetic
    problems/cd_drive/tolerance/test_switching_checks.py
        test_cells_that_are_missing_overlap_or_lie_outside
    problems/quick/test_quick.py
        test_the_bounds_of_mu_enclose_it
workbench/uncertainty/covers/weights.py beyond
    uncertainty/test_joint.py
        test_of_high_power_the_size_is_that_of_sets_that_contain
    uncertainty/test_covers.py
        test_every_array_has_a_unit_and_a_name
    problems/cd_drive/uncertainty/test_cover_problems.py
        test_a_cover_of_identified_drives
workbench/mu/upper/path.py follow
    mu/test_below.py
        test_multipliers_of_neighbours_serve_smooth_responses
    mu/test_members.py
        test_bundles
    problems/cd_drive/tolerance/test_lower_bandwidth.py
        test_its_certificate_holds
"""


def known_edits() -> dict[tuple[str, str], list[tuple[str, str]]]:
    """File and function of each edit, with the files and names of tests that fail with it."""
    found: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for line in FAILING.strip().splitlines():
        if not line.startswith(" "):
            file, name = line.split()
            tests = found.setdefault((file, name), [])
        elif line.endswith(".py"):
            place = f"tests/{line.strip()}"
        else:
            tests.append((place, line.strip()))
    return found


def raising(text: str, name: str) -> str:
    """The text of a module in which a function raises an error."""
    function = next(one for one in ast.parse(text).body if getattr(one, "name", "") == name)
    lines = text.splitlines(keepends=True)
    first = function.body[0]
    place = first.end_lineno if ast.get_docstring(function) else first.lineno - 1
    return "".join([*lines[:place], f"    raise ArithmeticError({name!r})\n", *lines[place:]])
