#pragma once

#include <string>
#include <string_view>

#include "pepeseg/v1/job_service.pb.h"

// Names of stages and of their parts, as core, the database, logs and metrics have them, and the
// enums of the contract.
namespace pepeseg {

// Returns the stage "prepare", "reconstruct", ...; UNSPECIFIED for any other name.
v1::JobStage StageOfName(std::string_view name);
// Returns the stage's name; empty for UNSPECIFIED and for numbers that are not values of the enum.
std::string NameOfStage(v1::JobStage stage);

// Returns the part of a stage that SkippedTerm::term names; UNSPECIFIED for any other name.
v1::JobEvent::TermSkipped::Term TermOfName(std::string_view name);
// Returns the part's name; empty for UNSPECIFIED and for numbers that are not values of the enum.
std::string NameOfTerm(v1::JobEvent::TermSkipped::Term term);

}  // namespace pepeseg
