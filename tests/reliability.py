"""The rows of docs/internals/reliability.md: promises, their tests, and what shows they can fail.

Names are `file::test`; files in soak/ run in `make soak`, all others in `make test`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One promise.

    Attributes
    ----------
    promise, claim : str
        What is promised, and the figure.
    tests : tuple of str
        What holds it.
    control : tuple of str
        Tests that see the failure where the guard is taken away.
    """

    promise: str
    claim: str
    tests: tuple[str, ...]
    control: tuple[str, ...] = ()


FORKED = "soak/test_soak_processes.py::"
STOPPED = "soak/test_soak_interrupted.py::"
FUZZED = "soak/test_soak_input.py::"
KEPT = "test_io_atomic.py::"

SECTIONS: dict[str, list[Row]] = {
    "Determinism, processes, interpreter": [
        Row("1, 2, 3, 8 threads x thread, fork, spawn, forkserver x forward, reverse, shuffled",
            "4 scenes, SHA-256 equal",
            ("test_determinism.py::test_threads_processes_and_orders",),
            ("test_determinism.py::test_what_depends_on_the_order_would_be_seen",)),
        Row("Reproducible mode", "the same bits with AVX-512, AVX2 and portable code",
            ("test_reproducible.py::test_every_level_gives_the_same_bits",
             "test_reproducible.py::test_an_old_processor_gives_the_same_bits",
             "test_reproducible.py::test_switching_is_as_starting_so",
             "test_sequence.py::test_the_two_modes_are_never_mixed",
             "test_cluster_trouble.py::test_16_3_tasks_on_one_worker_keep_their_modes",
             "test_cluster_trouble.py::test_16_3_a_scope_is_its_threads_alone"),
            ("test_reproducible.py::test_without_the_mode_levels_differ",)),
        Row("Kept hashes of frames", "change only with a line in the changelog",
            ("test_determinism.py::test_kept_hashes",
             "test_determinism.py::test_a_change_of_frames_is_told"),
            ("test_determinism.py::test_a_change_that_is_not_told_would_be_seen",)),
        Row("Fork after use", "100 forks, half of them from a busy process: 0 hang",
            ("test_gate.py::test_forks_after_use", FORKED + "test_hundred_forks"),
            # A lock that nobody frees ends by its alarm, in the same program.
            ("test_gate.py::test_forks_after_use",)),
        Row("multiprocessing, joblib and Dask workers (DataLoader: `make test-hosts`)",
            "0 hangs, one set for any number of workers",
            ("test_augment_workers.py::test_processes", "test_augment_workers.py::test_joblib",
             "test_augment_corrupt.py::test_one_set_whatever_the_workers",
             "test_augment_workers.py::test_threads"),
            ("test_augment_workers.py::test_no_two_are_alike",)),
        Row("pickle, copy, deepcopy", "every public class, frame 7 the same, <= 4 KiB",
            ("test_determinism.py::test_copies_give_the_same_frame",
             "test_determinism.py::test_every_public_class_is_copied",
             "test_scene.py::test_what_holds_no_picture_is_small"),
            ("test_determinism.py::test_a_copy_that_forgets_would_be_seen",)),
        Row("16 threads on one object", "equal results",
            ("test_gate.py::test_many_threads_on_one_scene",),
            ("test_gate.py::test_a_shared_buffer_would_be_seen",)),
        Row("The interpreter is free during a frame",
            "another thread at >= 80 % of its pace in a frame of 4k",
            ("test_gate.py::test_the_gil_is_free_during_a_frame",
             FORKED + "test_another_thread_goes_on_during_a_frame_of_4k"),
            ("test_gate.py::test_the_gil_is_free_during_a_frame",)),
        Row("Ctrl-C", "heard within 0.5 s in a frame of 16k; the next call works",
            ("test_gate.py::test_ctrl_c_is_heard_in_a_kernel",
             FORKED + "test_ctrl_c_in_a_frame_of_16k"),
            ("test_gate.py::test_ctrl_c_is_heard_in_a_kernel",)),
        Row("Panics", "an error of ours, never a PanicException",
            ("test_gate.py::test_a_defect_of_ours_is_an_error_of_ours",)),
        Row("Import and exit", "0 threads at import; 100 of 100 clean exits while threads render",
            ("test_gate.py::test_import_starts_nothing_and_loads_little",
             "test_gate.py::test_clean_exits_while_a_daemon_thread_renders",
             FORKED + "test_hundred_exits_while_daemon_threads_render"),
            ("test_gate.py::test_an_exit_that_is_not_clean_would_be_seen",)),
        Row("A free-threaded Python", "refused at import with a sentence",
            ("test_packaging.py::test_16_15_a_free_threaded_python_is_refused_with_a_sentence",)),
        Row("Memory", "<= 1 MiB in 10,000 frames",
            ("test_gate.py::test_memory_stays_flat",
             FORKED + "test_memory_over_ten_thousand_frames"),
            (FORKED + "test_a_leak_is_seen",)),
    ],
    "Bad input": [
        Row("Arrays: 10 layouts x 8 dtypes, 14 that are no such array, out over an input",
            "every public function: right or refused by name",
            ("test_public.py::test_arrays_of_every_layout_and_dtype",
             "test_public.py::test_what_is_no_such_array", "test_public.py::test_output_arrays",
             "test_public.py::test_everything_public_has_a_call"),
            ("test_public.py::test_a_mistake_would_be_seen",)),
        Row("Arguments: NaN, infinities, 2^31 +- 1, 2^63, long strings, random values",
            "documented exceptions that name them, <= 50 ms, <= 64 MiB",
            ("test_public.py::test_arguments", FUZZED + "test_random_arguments"),
            ("test_public.py::test_a_mistake_would_be_seen",)),
        Row("Sizes", "MemoryError or ValueError under RLIMIT_AS, never an abort",
            ("test_public.py::test_sizes_beyond_the_memory",
             "test_gate.py::test_memory_that_is_not_there_is_an_error",)),
        Row("Scene files", "strict; the line and the nearest name; <= 1 MiB",
            ("test_scenefile.py::test_a_mistake_is_told_with_its_place",
             "test_scenefile.py::test_a_file_of_just_a_mebibyte_is_read",
             "test_io_limits.py::test_16_8_a_key_of_40_kb_of_dots",
             "test_io_limits.py::test_16_8_twenty_thousand_effects",
             FUZZED + "test_damaged_files_of_every_kind"),
            ("test_scenefile.py::test_a_plain_reader_takes_what_we_refuse",)),
        Row("Output patterns", "300 hostile ones refused, 0 files outside",
            ("test_io_sequences.py::test_hostile_patterns_are_refused",
             "test_io_sequences.py::test_a_pattern_stays_inside_its_folder"),
            ("test_io_sequences.py::test_without_the_check_patterns_reach_outside",)),
        Row("Damaged backgrounds", "one error naming file and frame, or a whole picture; 0 hangs",
            ("test_io_damage.py::test_a_picture_that_broke_off_is_an_error",
             "test_sequence.py::test_it_stops_at_a_damaged_frame",
             "test_sequence.py::test_it_skips_damaged_frames",
             "test_sequence.py::test_it_holds_the_last_good_frame",
             FUZZED + "test_damaged_files_of_every_kind"),
            ("test_io_damage.py::test_without_the_guards_half_a_jpeg_is_half_grey",)),
        Row("Small files that claim much, FIFOs, devices, mutants of every kind of file",
            "refused by name, before anything is decoded; within 2 GiB and 20 s each",
            ("test_io_limits.py::test_16_8_a_small_file_that_claims_many_pixels",
             "test_io_limits.py::test_16_8_a_budget_of_pixels_and_of_bytes",
             "test_io_limits.py::test_16_8_what_is_no_plain_file_is_not_read",
             "test_io_limits.py::test_16_8_text_files_have_a_largest_size",
             "test_io_limits.py::test_16_8_hundreds_of_damaged_files_of_every_kind",
             FUZZED + "test_damaged_files_of_every_kind"),
            ("test_io_limits.py::test_16_8_a_link_to_a_plain_file_is_read",)),
        Row("Backgrounds with alpha, float pictures of levels",
            "premultiplied over, alpha kept both ways; one warning",
            ("test_scene_alpha.py::test_16_7_weather_over_alpha_is_premultiplied",
             "test_scene_alpha.py::test_16_7_files_with_alpha_go_in_and_come_out",
             "test_scene_alpha.py::test_16_7_a_float_picture_of_levels_is_warned_of",
             "test_augment_corrupt.py::test_16_7_alpha_is_kept_and_weather_falls_on_the_color"),
            ("test_scene_alpha.py::test_16_7_bright_light_is_not",)),
        Row("The viewer's server", "400, 503, 404, never a traceback; the token in no process list",
            ("test_viewer_server.py::test_16_13_numbers_out_of_all_bounds_answer_400",
             "test_viewer_server.py::test_16_13_an_odd_content_length_answers_400",
             "test_viewer_server.py::test_16_13_connections_are_capped",
             "test_viewer_server.py::test_16_13_the_token_is_in_no_list_of_processes"),
            ("test_viewer_server.py::test_a_question_is_answered",)),
    ],
    "Files": [
        Row("kill -9, then resume", "0 partial frames, the same bits, nothing left over",
            ("test_io_atomic.py::test_killed_writers_leave_no_partial_picture",
             "test_nothing_wrong.py::test_16_10_processes_do_not_end_each_other",
             STOPPED + "test_killed_and_resumed",
             STOPPED + "test_16_hundred_rounds_of_four_processes"),
            (STOPPED + "test_without_the_guard_kills_leave_partial_frames",
             "test_io_atomic.py::test_writing_in_place_loses_the_old_file")),
        Row("Ctrl-C, then resume", "the same, and nothing left over even before",
            ("test_cli_stopped.py::test_ctrl_c_keeps_what_is_done_and_goes_on",
             "test_cli_stopped.py::test_ctrl_c_leaves_no_half_a_film",
             STOPPED + "test_ctrl_c_and_resumed"),
            (STOPPED + "test_without_the_guard_kills_leave_partial_frames",)),
        Row("A Dask worker killed", "the same bits, nothing left over",
            ("test_cluster.py::test_a_worker_that_is_killed_loses_nothing",
             STOPPED + "test_dask_workers_killed"),
            # Where no worker lives to take it up, the frames are missing, and named.
            ("test_cluster.py::test_frames_that_kill_every_worker_are_named",)),
        Row("A resume knows its scene",
            "another scene's frames are refused; nothing private inside",
            ("test_render.py::test_headers_say_which_frame_and_nothing_private",
             "test_sequence.py::test_the_manifest_has_a_hash_of_each_frame"),
            ("test_sequence.py::test_without_the_mark_scenes_would_be_mixed",)),
        Row("A retouched plate", "known by its bytes; its frames are made again, or the run ends",
            ("test_nothing_wrong.py::test_16_1_a_retouched_plate_makes_its_frames_again",
             "test_nothing_wrong.py::test_16_1_a_plate_that_changes_meanwhile_ends_the_run",
             "test_nothing_wrong.py::"
             "test_16_1_of_a_sequence_the_frames_of_the_changed_plate_alone")),
        Row("Another version's frames", "kept only where the versions have the same bits",
            ("test_nothing_wrong.py::"
             "test_16_2_frames_of_another_version_are_kept_only_with_its_bits",)),
        Row("Damaged or foreign files", "made again; refused; whatever the format",
            ("test_nothing_wrong.py::test_16_5_damaged_frames_are_made_again",
             "test_nothing_wrong.py::test_16_5_foreign_files_are_refused",
             "test_nothing_wrong.py::test_21_one_rule_about_existing_files",
             "test_nothing_wrong.py::"
             "test_21_a_cut_film_and_a_film_over_a_retouched_plate_are_made_again")),
        Row("An empty or cut flurries.json", "made again from the frames' headers, with a word",
            ("test_nothing_wrong.py::test_16_11_a_cut_manifest_is_made_again",)),
        Row("What is left over", "one's own dead processes', or an hour old",
            ("test_nothing_wrong.py::test_16_10_leftovers_of_other_machines_stay_for_an_hour",)),
        Row("A cluster that cannot work", "says what it waits for, and stops; one sentence",
            ("test_cluster_trouble.py::test_16_4_no_success_without_the_files",
             "test_cluster_trouble.py::test_16_9_without_workers_it_says_so_and_stops",
             "test_cluster_trouble.py::test_16_9_a_scheduler_that_dies_is_one_sentence",
             "test_cluster_trouble.py::test_16_9_an_address_that_is_none_is_one_sentence")),
        Row("Disk full, read-only, FIFO, link, folder",
            "OSError naming the file; what was there stays",
            (KEPT + "test_a_full_disk_leaves_the_old_file",
             "test_nothing_wrong.py::test_16_12_a_full_disk_says_so_with_the_frames_name",
             KEPT + "test_read_only_folders_and_files_as_an_ordinary_user",
             KEPT + "test_odd_targets_are_refused_by_name"),
            (KEPT + "test_writing_in_place_loses_the_old_file",)),
        Row("Stores: local, a disk that fills, memory, s3, read-only, one that vanishes",
            "no frame lost, no false success",
            ("test_stores.py::test_16_14_frames_are_the_same_bytes_in_every_store",
             "test_stores.py::test_16_14_what_is_not_ours_is_refused",
             "test_stores.py::test_16_14_several_at_the_same_frames_end_with_the_same_bits",
             "test_stores.py::test_16_14_workers_write_to_s3",
             "test_stores.py::test_16_14_a_disk_that_fills",
             "test_stores.py::test_16_14_a_read_only_disk",
             "test_stores.py::test_16_14_a_read_only_store",
             "test_stores.py::test_16_14_a_store_that_vanishes",
             "test_stores.py::test_16_14_where_halves_are_seen_frames_are_renamed"),
            ("test_stores.py::test_16_14_a_store_that_keeps_half_is_no_success",)),
        Row("Large frames", "peak memory <= the frame + 64 MiB, + 16 MiB for each further texture",
            (FORKED + "test_peak_memory_of_a_large_frame",
             "test_bands.py::test_bands_have_the_bits_of_the_whole"),
            (FORKED + "test_without_bands_a_large_frame_takes_more",
             "test_bands.py::test_a_window_that_is_not_the_wholes_part_would_be_seen")),
        Row("Read back", "f32 EXR bit for bit, half within half an ulp, integers exact",
            ("test_io_pictures.py::test_float32_comes_back_bit_for_bit",
             "test_io_pictures.py::test_half_is_within_half_an_ulp",
             "test_io_pictures.py::test_integers_come_back_exactly"),
            ("test_io_atomic.py::test_a_picture_that_reads_back_wrong_is_not_kept",)),
    ],
    "Laws": [
        Row("Rates and extinctions of snow and rain, in rendered frames",
            "as asked within 2 % and two standard errors: five rates, walls at 20, 60 and 200 m",
            ("soak/test_soak_population.py::test_rates_and_extinctions_are_shown_as_asked",)),
    ],
}  # fmt: skip


def named() -> set[str]:
    """Return every test of the page."""
    rows = [row for section in SECTIONS.values() for row in section]
    return {test for row in rows for test in (*row.tests, *row.control)}
