#pragma once

#include <string>

#include "pepeseg/v1/access.pb.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/server_status.pb.h"

// Values of the contract's enums as people read them.
namespace pepeseg::client::cli {

// Each returns the name of a value in lower case and without the prefix of its type: "reconstruct"
// for JOB_STAGE_RECONSTRUCT. Returns "" for UNSPECIFIED, and the number of a value that this
// program does not know, which a newer server sends.
std::string WordOf(v1::JobState state);
std::string WordOf(v1::JobStage stage);
std::string WordOf(v1::JobEvent::TermSkipped::Term term);
std::string WordOf(v1::Scope scope);
std::string WordOf(v1::ServerStatus::Work work);

}  // namespace pepeseg::client::cli
