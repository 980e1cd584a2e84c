#pragma once

#include <span>
#include <string>
#include <vector>

#include "clients/benchmark/suite_record.h"
#include "clients/benchmark/suite_scene.h"
#include "clients/terminal/text_table.h"

// Tables of a benchmark's runs. Three choices of the scale are kept apart in all of them:
//   reference   chosen on the reference view, which is not scored
//   automatic   chosen without any truth
//   paper*      chosen on the truth of the scored views, as published: a bound that no user reaches
namespace pepeseg::client::cli {

// A row of a paper. Numbers are percentages; below 0: not published.
struct PublishedRow {
  const char* method;
  double iou, accuracy, boundary_iou;
};
// Returns the published rows of a benchmark, the best first; none for kScene.
std::span<const PublishedRow> PublishedRows(Benchmark benchmark);

// Returns a line for a person about one run.
std::string LineOf(const ScoredRun& run);

// Returns the table of a group of runs, the header first: a row for each variant and scene, with
// mean and standard deviation over seeds ("91.2 +- 0.4"), and the mean of scenes for each variant.
std::vector<TableRow> SceneTable(std::span<const ScoredRun> runs);

// Returns the table of the published rows and ours, sorted by mIoU. The best mIoU is in bold
// ("**92.3**") only if it is ours by `reference` or `automatic`: published numbers and ours by
// paper* used the scored truth. Empty: nothing is published.
std::vector<TableRow> PublishedTable(Benchmark benchmark, std::span<const ScoredRun> runs);

// Returns a sentence on what makes the rows of these runs in PublishedTable other than the
// published ones, such as an easier prompt; empty: nothing that is known. The runs have one
// protocol.
std::string PublishedCaveat(Benchmark benchmark, std::span<const ScoredRun> runs);

// Returns tables as files have them.
std::string Markdown(const std::vector<TableRow>& rows);
std::string Csv(const std::vector<TableRow>& rows);

// Returns the whole report: both tables, with what their columns mean and PublishedCaveat.
std::string ReportMarkdown(Benchmark benchmark, std::span<const ScoredRun> runs);

}  // namespace pepeseg::client::cli
