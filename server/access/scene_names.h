#pragma once

#include <google/protobuf/message.h>

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/authorizer.h"
#include "server/api/resource_name.h"
#include "server/store/store.h"

namespace pepeseg {

// Returns PERMISSION_DENIED for a field that names nothing of the caller's project.
absl::Status NotYoursError(const std::string& field);

// Finds the scenes that the resource names of an authorised request mean. Which fields name
// resources is said by the method's option `access`. NotYoursError: the caller's project has no
// scene of the name.
//
// A caller who sees all projects may name one, "projects/{project}/scenes/{scene}...". Otherwise
// the scene of the default project is meant, else the only scene with this name.
// A name that there is not means a scene with the id 0, so that the handler reports NOT_FOUND in
// its own words. FAILED_PRECONDITION: several projects have such a scene.
absl::StatusOr<NamedScenes> ResolveSceneNames(Store& store, const Caller& caller,
                                              const google::protobuf::Message& request);

// Resolves one name of an operator's call, which sees all projects. `field`: for errors.
absl::StatusOr<NamedScenes> ResolveOperatorsName(Store& store, const std::string& name,
                                                 const std::string& field);

}  // namespace pepeseg
