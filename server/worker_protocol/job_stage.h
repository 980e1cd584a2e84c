#pragma once

#include <string>
#include <string_view>

#include "core/base/stage.h"
#include "pepeseg/v1/job_service.pb.h"

// Stages and their parts as the contract has them. The database and metrics have their names.
namespace pepeseg {

v1::JobStage ToProto(Stage stage);
v1::JobEvent::TermSkipped::Term ToProto(Part part);

// Returns the stage "prepare", "reconstruct", ...; UNSPECIFIED for any other name.
v1::JobStage StageOfName(std::string_view name);
// Returns the stage's name; empty for UNSPECIFIED and for numbers that are not values of the enum.
std::string NameOfStage(v1::JobStage stage);

}  // namespace pepeseg
