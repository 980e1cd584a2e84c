#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "pepeseg/v1/access.pb.h"

// The contract's option `access` (access.proto) of each method: the scope that a call needs, the
// fields of its request that name resources, and the threads that run it.
namespace pepeseg {

// A string field, possibly in nested messages: "prompt.label".
struct FieldPath {
  std::string name;
  std::vector<const google::protobuf::FieldDescriptor*> fields;  // the last one is a string
};

struct MethodAccess {
  std::string method;  // "pepeseg.v1.SceneService.GetScene"
  v1::Scope scope = v1::SCOPE_UNSPECIFIED;
  v1::Pool pool = v1::POOL_UNSPECIFIED;
  std::vector<FieldPath> resources;
};

// A resource that a request names.
struct NamedResource {
  std::string field;  // FieldPath::name
  std::string name;
};

// Returns the option of the method with this request type; every method has its own. Returns null
// if no method has it, or if the option lacks a scope or
// a pool, or names a field that does not exist.
const MethodAccess* FindMethodAccess(const google::protobuf::Descriptor& request);

// Returns the resources that a request names, in the order of the option. Fields that are absent or
// empty are left out.
std::vector<NamedResource> ResourcesOf(const MethodAccess& access,
                                       const google::protobuf::Message& request);

}  // namespace pepeseg
