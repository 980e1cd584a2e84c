#include "server/access/method_access.h"

#include <google/protobuf/descriptor_database.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "tests/server/access/all_methods.h"

namespace pepeseg {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::MethodDescriptor;

TEST(MethodAccess, CoversEveryMethodOfThePackage) {
  const auto methods = testing::AllMethods();
  EXPECT_GE(methods.size(), 53u);
  for (const MethodDescriptor* method : methods) {
    const MethodAccess* access = FindMethodAccess(*method->input_type());
    ASSERT_NE(access, nullptr) << method->full_name() << " declares no scope, or no such field";
    // Another name here would mean that two methods share a request type.
    EXPECT_EQ(access->method, method->full_name());
    const v1::Access& option = method->options().GetExtension(v1::access);
    EXPECT_EQ(access->scope, option.scope());
    EXPECT_EQ(access->pool, option.pool());
    EXPECT_EQ(access->pool == v1::POOL_ADMIN, method->service()->name() == "AdminService");
    EXPECT_EQ(access->resources.size(), static_cast<size_t>(option.resources_size()));
  }
}

TEST(MethodAccess, AllowsTheAdminServiceToOperatorsOnly) {
  for (const MethodDescriptor* method : testing::AllMethods()) {
    const bool is_admin = method->service()->name() == "AdminService";
    const v1::Scope scope = FindMethodAccess(*method->input_type())->scope;
    EXPECT_EQ(scope == v1::SCOPE_OPERATE, is_admin) << method->full_name();
  }
}

TEST(MethodAccess, DeclaresStringsOnlyAsResources) {
  for (const MethodDescriptor* method : testing::AllMethods()) {
    for (const FieldPath& path : FindMethodAccess(*method->input_type())->resources) {
      ASSERT_FALSE(path.fields.empty());
      EXPECT_EQ(path.fields.back()->type(), FieldDescriptor::TYPE_STRING) << path.name;
      EXPECT_EQ(path.fields.front()->containing_type(), method->input_type()) << path.name;
    }
  }
}

// Returns the paths of the fields whose names say that they hold a resource name.
void FindNames(const Descriptor& message, const std::string& prefix,
               std::vector<std::string>& paths) {
  static const std::set<std::string> kNames = {
      "name",   "parent",    "scene", "dataset", "model",  "job",        "label",
      "upload", "selection", "base",  "first",   "second", "live_model", "active_job"};
  ASSERT_LT(std::count(prefix.begin(), prefix.end(), '.'), 8) << "a message that holds itself";
  for (int i = 0; i < message.field_count(); ++i) {
    const FieldDescriptor& field = *message.field(i);
    if (field.message_type() != nullptr && !field.is_map()) {
      FindNames(*field.message_type(), absl::StrCat(prefix, field.name(), "."), paths);
    } else if (kNames.count(field.name()) > 0 && field.type() == FieldDescriptor::TYPE_STRING) {
      paths.push_back(absl::StrCat(prefix, field.name()));
    }
  }
}

TEST(MethodAccess, DeclaresEveryFieldThatNamesAResource) {
  // Output only: no handler reads them in a request.
  const std::set<std::string> not_read = {
      "CreateSceneRequest.scene.name", "CreateSceneRequest.scene.live_model",
      "CreateSceneRequest.scene.active_job", "CreateLabelRequest.label.name"};
  int found = 0;
  for (const MethodDescriptor* method : testing::AllMethods()) {
    const MethodAccess& access = *FindMethodAccess(*method->input_type());
    if (access.scope == v1::SCOPE_OPERATE) continue;  // such calls are for all projects
    std::vector<std::string> paths;
    FindNames(*method->input_type(), "", paths);
    for (const std::string& path : paths) {
      const std::string full = absl::StrCat(method->input_type()->name(), ".", path);
      if (not_read.count(full) > 0) continue;
      ++found;
      EXPECT_TRUE(std::any_of(access.resources.begin(), access.resources.end(),
                              [&](const FieldPath& resource) { return resource.name == path; }))
          << full << " is not in the option of " << method->full_name();
    }
  }
  EXPECT_GE(found, 35);
}

TEST(MethodAccess, ReadsTheNamesThatAreThere) {
  v1::SegmentViewsRequest request;
  const MethodAccess& access = *FindMethodAccess(*request.GetDescriptor());
  EXPECT_TRUE(ResourcesOf(access, request).empty());
  request.set_model("scenes/a/models/1");
  request.mutable_prompt()->mutable_points();
  ASSERT_EQ(ResourcesOf(access, request).size(), 1u);
  EXPECT_EQ(ResourcesOf(access, request)[0].field, "model");
  request.mutable_prompt()->set_label("scenes/b/labels/cup");
  ASSERT_EQ(ResourcesOf(access, request).size(), 2u);
  EXPECT_EQ(ResourcesOf(access, request)[1].field, "prompt.label");
  EXPECT_EQ(ResourcesOf(access, request)[1].name, "scenes/b/labels/cup");
}

TEST(MethodAccess, ReturnsNullForRequestsOfNoMethod) {
  EXPECT_EQ(FindMethodAccess(*v1::Prompt::descriptor()), nullptr);
}

}  // namespace
}  // namespace pepeseg
