#include "server/worker_protocol/job_stage.h"

namespace pepeseg {

// Both enums have the same values in the same order, after UNSPECIFIED in the contract.
static_assert(v1::JobStage_ARRAYSIZE == kNumStages + 1);
static_assert(v1::JobEvent::TermSkipped::Term_ARRAYSIZE == kNumParts + 1);

v1::JobStage ToProto(Stage stage) { return static_cast<v1::JobStage>(static_cast<int>(stage) + 1); }

v1::JobEvent::TermSkipped::Term ToProto(Part part) {
  return static_cast<v1::JobEvent::TermSkipped::Term>(static_cast<int>(part) + 1);
}

v1::JobStage StageOfName(std::string_view name) {
  const auto stage = StageNamed(name);
  return stage ? ToProto(*stage) : v1::JOB_STAGE_UNSPECIFIED;
}

std::string NameOfStage(v1::JobStage stage) {
  if (stage == v1::JOB_STAGE_UNSPECIFIED || !v1::JobStage_IsValid(stage)) return "";
  return std::string(NameOf(static_cast<Stage>(static_cast<int>(stage) - 1)));
}

}  // namespace pepeseg
