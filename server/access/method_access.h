#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "pepeseg/v1/access.pb.h"

// What the contract's option `access` says of each method.
namespace pepeseg {

// A field of a message in a message ...: "prompt.label".
struct FieldPath {
  std::string name;
  std::vector<const google::protobuf::FieldDescriptor*> fields;  // the last one is a string
};

struct MethodAccess {
  std::string method;  // "pepeseg.v1.SceneService.GetScene"
  v1::Scope scope = v1::SCOPE_UNSPECIFIED;
  std::vector<FieldPath> resources;
};

// A resource that a request names, and by which of its fields.
struct NamedResource {
  std::string field;
  std::string name;
};

// Of the method whose request this is: every method has a request type of its own. Null: of none,
// or of one whose option does not say its scope or names a field that is none.
const MethodAccess* FindMethodAccess(const google::protobuf::Descriptor& request);

// In the order of the option; fields that are absent or empty name nothing.
std::vector<NamedResource> ResourcesOf(const MethodAccess& access,
                                       const google::protobuf::Message& request);

// Changes the one that `field` names, which ResourcesOf has given.
void SetResource(const MethodAccess& access, const std::string& field, const std::string& name,
                 google::protobuf::Message& request);

}  // namespace pepeseg
