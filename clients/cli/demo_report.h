#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "clients/cli/demo_score.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {

// All that `pepeseg demo` has measured.
struct DemoResult {
  v1::Job job;
  v1::Model model;
  // Wall time, seconds: "upload", each stage of the job, "train" (the whole job) and "questions"
  // (all queries).
  std::map<std::string, double> stage_seconds;
  FixedGranularity fixed;
  DemoScores scores;

  // Returns the mean over the products of their mean IoU at the fixed granularity, clicked view
  // included.
  double MeanIou() const;
};

// Returns the text of report.json.
std::string ReportJson(const DemoResult& result);

// Returns the report for a person.
std::string ReportText(const DemoResult& result);

// Writes to `folder`, for each view, overview-STEM.png with all products, and PRODUCT-STEM.png for
// each product that it shows: photograph with label and click, rendering, mask over the photograph.
absl::Status WritePictures(const std::filesystem::path& folder, const Client& client,
                           const std::vector<DemoView>& views, const DemoResult& result);

}  // namespace pepeseg::client::cli
