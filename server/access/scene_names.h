#pragma once

#include <google/protobuf/message.h>

#include "absl/status/status.h"
#include "server/access/authorizer.h"
#include "server/store/store.h"

namespace pepeseg {

// Replaces scene ids by scene keys in all resource names of an authorised request: handlers and the
// store know scenes by their keys only (server/store/scene_key.h). Which fields name resources is
// said by the method's option `access`. An id that the caller's project does not have becomes a key
// that no scene has.
//
// A caller who sees all projects may name one, "projects/{project}/scenes/{scene}...". Otherwise
// the scene of the default project is meant, else the only scene with this id.
// FAILED_PRECONDITION: several projects have such a scene. INVALID_ARGUMENT: the name is malformed.
absl::Status ResolveSceneNames(Store& store, const Caller& caller,
                               google::protobuf::Message& request);

// Resolves one name of an operator's call, which sees all projects. `field`: for errors.
absl::StatusOr<std::string> ResolveOperatorsName(Store& store, const std::string& name,
                                                 const std::string& field);

}  // namespace pepeseg
