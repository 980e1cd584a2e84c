#include "server/worker_protocol/job_stage.h"

#include <array>
#include <utility>

namespace pepeseg {
namespace {

using Skipped = v1::JobEvent::TermSkipped;

constexpr std::array<std::pair<v1::JobStage, const char*>, 7> kStages = {
    {{v1::JOB_STAGE_PREPARE, "prepare"},
     {v1::JOB_STAGE_SFM, "sfm"},
     {v1::JOB_STAGE_PRIORS, "priors"},
     {v1::JOB_STAGE_RECONSTRUCT, "reconstruct"},
     {v1::JOB_STAGE_EVALUATE, "evaluate"},
     {v1::JOB_STAGE_FEATURES, "features"},
     {v1::JOB_STAGE_INDEX, "index"}}};
constexpr std::array<std::pair<Skipped::Term, const char*>, 7> kTerms = {
    {{Skipped::TERM_DEPTH, "depth"},
     {Skipped::TERM_REFINEMENT, "refinement"},
     {Skipped::TERM_BANDS, "bands"},
     {Skipped::TERM_STEPS, "steps"},
     {Skipped::TERM_BACKGROUND, "background"},
     {Skipped::TERM_CENTROIDS, "centroids"},
     {Skipped::TERM_PERCEPTION, "perception"}}};

template <typename Table>
auto ValueOf(const Table& table, std::string_view name) {
  for (const auto& [value, known] : table) {
    if (known == name) return value;
  }
  return decltype(table[0].first){};
}

template <typename Table, typename Value>
std::string NameIn(const Table& table, Value value) {
  for (const auto& [known, name] : table) {
    if (known == value) return name;
  }
  return "";
}

}  // namespace

v1::JobStage StageOfName(std::string_view name) { return ValueOf(kStages, name); }
std::string NameOfStage(v1::JobStage stage) { return NameIn(kStages, stage); }
Skipped::Term TermOfName(std::string_view name) { return ValueOf(kTerms, name); }
std::string NameOfTerm(Skipped::Term term) { return NameIn(kTerms, term); }

}  // namespace pepeseg
