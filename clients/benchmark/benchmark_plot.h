#pragma once

#include <span>
#include <string>

#include "clients/benchmark/benchmark_record.h"
#include "clients/benchmark/benchmark_scene.h"

// The plot of a benchmark's runs.
namespace pepeseg::client::cli {

// Returns an SVG with a panel for each scene, and in it a bar for the IoU of each entity, the best
// first, and one for their mean. Runs of one variant with the same options are one series, which
// has a colour: its bars are means over seeds, with a whisker of one standard deviation on both
// sides. If there are more than 4 series, only the means are drawn. All bars have the same choice
// of the scale, which the plot names: the first of automatic, reference and paper* that was
// measured. Empty: no run has scores.
std::string EntityPlot(Benchmark benchmark, std::span<const ScoredRun> runs);

}  // namespace pepeseg::client::cli
