//! The tables of the documents.

/// A table: rows and columns of a CSV file, in the file's order.
pub(super) struct Table {
    /// The name, which stands in the mark.
    pub(super) name: &'static str,
    /// The file in `docs/benchmarks/results`, without its ending.
    pub(super) csv: &'static str,
    /// The columns that choose rows, each with its values, separated by `|`.
    pub(super) rows: &'static [(&'static str, &'static str)],
    /// The headings, each with its column, or with several columns that an arrow separates in each cell.
    pub(super) columns: &'static [(&'static str, &'static str)],
}

const FRAME: &str = "stock_frame_mean_ms → pbig_frame_mean_ms";
const FRAME_P99: &str = "stock_frame_p99_ms → pbig_frame_p99_ms";
const BROAD: &str = "stock_broad_mean_ms → pbig_broad_mean_ms";

/// All tables; each stands in one document.
#[rustfmt::skip]
pub(super) const TABLES: &[Table] = &[
    // README.md
    Table { name: "frames", csv: "frames", rows: &[],
        columns: &[("scene", "scene"), ("bodies", "bodies"), ("frames", "steps"), ("broad phase", BROAD), ("frame", FRAME), ("frame, p99", FRAME_P99)] },
    // docs/PERFORMANCE.md
    Table { name: "steady", csv: "steady",
        rows: &[
            ("motion", "drift|fall|jump|rest and burst|changing shares|few|churn"),
            ("boxes", "100000"), ("density", "dense"), ("threads", "2"), ("side", "ours")],
        columns: &[("motion", "motion"), ("mean", "mean_ms"), ("p99", "p99_ms"), ("worst", "worst_ms")] },
    Table { name: "hard", csv: "hard",
        rows: &[
            ("world", "uniform|two scales|mixed sizes above 2^100|needles in three directions|sheets in three directions"),
            ("boxes", "25000")],
        columns: &[("world", "world"), ("pairs", "pairs"), ("ms", "ms"), ("with a grid alone", "ms_of_a_grid_alone")] },
    Table { name: "queries", csv: "queries-036", rows: &[],
        columns: &[("queries", "queries"), ("frame", FRAME),
            ("its queries", "stock_queries_mean_ms → pbig_queries_mean_ms")] },
    Table { name: "crates", csv: "crates-036",
        rows: &[
            ("crate", "rapier2d"), ("scene", "rain|city"), ("bodies", "10000|100000")],
        columns: &[("scene", "scene"), ("bodies", "bodies"), ("frames", "steps"), ("broad phase", BROAD), ("frame", FRAME)] },
    Table { name: "peers", csv: "peers",
        rows: &[
            ("case", "events, all moved, unit|events, all drift, unit|events, 1% moved, unit|from scratch, unit"),
            ("boxes", "100000"),
            ("other", "parry 0.31, all threads|parry 0.31, changed pairs|parry 0.31 rebuilt|obvhs 0.4 ploc")],
        columns: &[("case", "case"), ("other", "other"), ("its time over pbig's", "other_over_pbig_median")] },
    Table { name: "memory", csv: "update",
        rows: &[("unit", "MB"), ("case", "memory, incremental, all moved|memory, from scratch")],
        columns: &[("case", "case"), ("boxes", "boxes"), ("MB", "pbig_median")] },
    // docs/DROP_IN.md
    Table { name: "lookup", csv: "lookup-036", rows: &[],
        columns: &[("scene", "scene"), ("bodies", "bodies"),
            ("rapier's own", "rapier_step_mean_ms → mended_step_mean_ms"),
            ("with pbig", "pbig_step_mean_ms → pbig_mended_step_mean_ms")] },
    // docs/GPU.md
    Table { name: "gpu-searches", csv: "gpu-searches",
        rows: &[("set", "uniform|mixed"), ("boxes", "100000|1000000|10000000")],
        columns: &[("set", "set"), ("boxes", "boxes"), ("pairs", "pairs"), ("CPU → GPU, ms", "cpu_ms → gpu_ms"),
            ("GPU alone, ms", "wait_ms")] },
    // docs/ACCURACY.md
    Table { name: "index", csv: "accuracy-index-all-pairs",
        rows: &[
            ("correction", "as it is"),
            ("root", "f32 sqrt|f64 sqrt|Carmack 1|Carmack 2|Carmack 3|as printed, in f32")],
        columns: &[("root", "root"), ("wrong, %", "wrong_percent"), ("first wrong n", "first_wrong_n")] },
    Table { name: "margin", csv: "accuracy-margin-means", rows: &[("margin", "0|0.01|0.05|0.5")],
        columns: &[("margin", "margin"), ("broad phase", "broad_phase"), ("noise, %", "broad_phase_noise_percent"),
            ("whole step", "whole_step"), ("noise, %", "whole_step_noise_percent"),
            ("most extra pairs, %", "largest_extra_percent")] },
    Table { name: "far", csv: "accuracy-wide-ways",
        rows: &[("offset", "100000|1000000")],
        columns: &[("distance", "offset"), ("boxes", "boxes"), ("pairs at the poses", "pairs_at_the_poses"),
            ("missed at the poses", "missed_at_the_poses"), ("missed against f64", "missed")] },
    Table { name: "drift", csv: "accuracy-simulation-drift", rows: &[("scene", "column|pile|pyramid|ragdolls")],
        columns: &[("scene", "scene"), ("steps", "steps"), ("farthest permuted run", "farthest_permuted"),
            ("pbig", "pbig"), ("stock, its events sorted", "stock_sorted")] },
    // docs/PAPERS.md
    Table { name: "papers-density", csv: "papers-pbig-table-iii-and-figure-10-density",
        rows: &[("DoC", "0.001|0.1|10")],
        columns: &[("DoC", "DoC"), ("pairs", "pairs printed (N = 10^7) → pairs"),
            ("checks", "checks printed (N = 10^7) → checks in such cells"), ("ms, pbig's grid", "ms, our grid, CPU")] },
    Table { name: "papers-bytes", csv: "papers-pbig-table-iii-and-figure-10-density-and-bytes-of-output-gpu",
        rows: &[("DoC", "0.001|0.1|10")],
        columns: &[("DoC", "DoC"), ("printed", "bytes a pair, MB = 2^20"), ("here", "records"),
            ("here, with the paper's cells", "records, the paper's W, rows of segments")] },
    Table { name: "papers-options", csv: "papers-pbig-table-iv-optimisations-on-and-off-gpu",
        rows: &[("setting", "+C|+P|+C+P+B")],
        columns: &[("setting", "setting"), ("side", "side"), ("ms", "total, ms"),
            ("speed-up", "speed-up by the totals")] },
    Table { name: "papers-grid", csv: "papers-avril-figure-4-and-table-7-brute-force-with-and-without-a-grid",
        rows: &[("objects", "100|1000|10000")],
        columns: &[("objects", "objects"),
            ("printed: without a grid → with it", "ms printed: without grid → ms printed: with grid"),
            ("here: brute force → Avril's cells", "ms, CPU: brute force → ms, CPU: Avril's cells, one thread"),
            ("pbig's grid", "ms, CPU: our grid")] },
    // docs/ARCHITECTURE.md
    Table { name: "mechanisms", csv: "mechanisms",
        rows: &[("verdict", "stays")],
        columns: &[("mechanism", "mechanism"), ("without / with", "without_over_with")] },
    // python/README.md
    Table { name: "ipctk", csv: "ipctk", rows: &[],
        columns: &[("scene", "scene"), ("faces", "faces"), ("candidates", "ipctk_pairs → pbig_pairs"),
            ("median", "ipctk_median_ms → pbig_median_ms"), ("slowest", "ipctk_slowest_ms → pbig_slowest_ms")] },
    // avian/README.md
    Table { name: "avian", csv: "avian", rows: &[],
        columns: &[("scene", "scene"), ("bodies", "bodies"),
            ("broad phase", "avian_broad_mean_ms → pbig_broad_mean_ms"),
            ("step", "avian_step_mean_ms → pbig_step_mean_ms"),
            ("step, p99", "avian_step_p99_ms → pbig_step_p99_ms")] },
];
