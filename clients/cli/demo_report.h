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

struct DemoResult {
  v1::Job job;
  v1::Model model;
  std::map<std::string, double> stage_seconds;  // "upload", the job's stages, "train", "questions"
  FixedQuestion question;
  DemoScores scores;

  double MeanIou() const;  // over products, at the fixed question, the clicked view too
};

// As report.json has it.
std::string ReportJson(const DemoResult& result);
// For a person.
std::string ReportText(const DemoResult& result);

// Per product and view: photo with label and click | rendering | mask over the photo; and one
// sheet a view with all products.
absl::Status WritePictures(const std::filesystem::path& folder, const Client& client,
                           const std::vector<DemoView>& views, const DemoResult& result);

}  // namespace pepeseg::client::cli
