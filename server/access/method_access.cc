#include "server/access/method_access.h"

#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_split.h"
#include "pepeseg/v1/admin_service.pb.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "pepeseg/v1/edit_service.pb.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/label_service.pb.h"
#include "pepeseg/v1/render_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "pepeseg/v1/selection_service.pb.h"

namespace pepeseg {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using Table = std::map<const Descriptor*, MethodAccess>;

// Returns the fields of a path such as "prompt.label", or nullopt if a part is not a field, is
// repeated, or the last is not a string.
std::optional<FieldPath> Resolve(const Descriptor& request, const std::string& name) {
  FieldPath path{name, {}};
  const Descriptor* message = &request;
  for (const auto& part : absl::StrSplit(name, '.')) {
    const FieldDescriptor* field =
        message == nullptr ? nullptr : message->FindFieldByName(std::string(part));
    // A repeated field would need a check of each element, which ReadPath does not do.
    if (field == nullptr || field->is_repeated()) return std::nullopt;
    path.fields.push_back(field);
    message = field->message_type();  // null for a field that is no message
  }
  if (path.fields.back()->type() != FieldDescriptor::TYPE_STRING) return std::nullopt;
  return path;
}

void AddMethod(const google::protobuf::MethodDescriptor& method, Table& table) {
  const v1::Access& option = method.options().GetExtension(v1::access);
  MethodAccess access{method.full_name(), option.scope(), option.pool(), {}};
  if (access.scope == v1::SCOPE_UNSPECIFIED || access.pool == v1::POOL_UNSPECIFIED)
    return;  // not in the table: nobody may call it
  for (const std::string& name : option.resources()) {
    auto path = Resolve(*method.input_type(), name);
    // A wrong path in the contract: the method gets no entry, so nobody may call it, rather than
    // anybody without a check.
    if (!path) return;
    access.resources.push_back(*std::move(path));
  }
  // The type of the request identifies the method: no two methods have the same one.
  table.emplace(method.input_type(), std::move(access));
}

// Reads the option of every method in the files of the contract that define services.
Table MakeTable() {
  Table table;
  for (const google::protobuf::FileDescriptor* file :
       {v1::GetSceneRequest::descriptor()->file(), v1::GetUploadRequest::descriptor()->file(),
        v1::GetJobRequest::descriptor()->file(), v1::SegmentViewsRequest::descriptor()->file(),
        v1::GetLabelRequest::descriptor()->file(), v1::GetSelectionRequest::descriptor()->file(),
        v1::RenderViewRequest::descriptor()->file(), v1::EvaluateModelRequest::descriptor()->file(),
        v1::EditModelRequest::descriptor()->file(), v1::LoadModelRequest::descriptor()->file()}) {
    for (int i = 0; i < file->service_count(); ++i) {
      const google::protobuf::ServiceDescriptor& service = *file->service(i);
      for (int k = 0; k < service.method_count(); ++k) AddMethod(*service.method(k), table);
    }
  }
  return table;
}

// Returns a field's value, "" if a message on the path is absent.
std::string ReadPath(const FieldPath& path, const google::protobuf::Message& request) {
  const google::protobuf::Message* message = &request;
  for (const FieldDescriptor* field : path.fields) {
    const google::protobuf::Reflection& reflection = *message->GetReflection();
    if (field->message_type() == nullptr) return reflection.GetString(*message, field);
    if (!reflection.HasField(*message, field)) return "";
    message = &reflection.GetMessage(*message, field);
  }
  return "";
}

}  // namespace

const MethodAccess* FindMethodAccess(const Descriptor& request) {
  static const Table table = MakeTable();
  const auto found = table.find(&request);
  return found == table.end() ? nullptr : &found->second;
}

std::vector<NamedResource> ResourcesOf(const MethodAccess& access,
                                       const google::protobuf::Message& request) {
  std::vector<NamedResource> resources;
  for (const FieldPath& path : access.resources) {
    std::string name = ReadPath(path, request);
    if (!name.empty()) resources.push_back({path.name, std::move(name)});
  }
  return resources;
}

}  // namespace pepeseg
