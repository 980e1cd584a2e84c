#pragma once

#include <google/protobuf/message.h>

#include "absl/status/status.h"
#include "server/access/authorizer.h"
#include "server/store/store.h"

namespace pepeseg {

// Puts the scenes' keys in the place of their ids in all names of resources that `request` names by
// its method's option `access`, once it is authorised: handlers and the store know scenes by their
// keys only (server/store/scene_key.h). An id that the caller's project does not have becomes a key
// that no scene has. A caller who sees all projects may say which one is meant,
// "projects/{project}/scenes/{scene}..."; else the default project's scene is, or the only one of
// the id. FAILED_PRECONDITION: there are several. INVALID_ARGUMENT: the name is none.
absl::Status ResolveSceneNames(Store& store, const Caller& caller,
                               google::protobuf::Message& request);

// The same of one name, of a call that is of all projects: an operator's.
absl::StatusOr<std::string> ResolveOperatorsName(Store& store, const std::string& name,
                                                 const std::string& field);

}  // namespace pepeseg
