// Calls every method of every service with every kind of key. What each must answer follows from
// the option `access` alone.
#include <google/protobuf/dynamic_message.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "tests/server/access/all_methods.h"
#include "tests/server/access/keyed_server.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::MethodDescriptor;

// Returns a resource name of the kind that the field holds.
std::string NameFor(const MethodDescriptor& method, const std::string& path,
                    const std::string& scene) {
  const std::string of_scene = absl::StrCat("scenes/", scene);
  static const std::map<std::string, std::string> kByField = {
      {"model", "/models/1"},
      {"dataset", "/datasets/1"},
      {"prompt.label", "/labels/red"},
      {"like.label", "/labels/red"},
      {"segment.prompt.label", "/labels/red"},
      {"segment.model", "/models/1"},
      {"base", "/selections/1"},
      {"first", "/selections/1"},
      {"second", "/selections/1"},
      {"subset.selection", "/selections/1"},
      {"overlay_subset.selection", "/selections/1"},
      {"header.upload", "/uploads/1"},
      {"scene", ""}};
  static const std::map<std::string, std::string> kByMethod = {
      {"ListViews", "/models/1"},        {"GetModel", "/models/1"},
      {"GetPhotograph", "/datasets/1"},  {"DeleteModel", "/models/1"},
      {"SetLiveModel", "/models/1"},     {"GetUpload", "/uploads/1"},
      {"SealUpload", "/uploads/1"},      {"DeleteUpload", "/uploads/1"},
      {"GetDataset", "/datasets/1"},     {"GetLabel", "/labels/red"},
      {"DeleteLabel", "/labels/red"},    {"UndoSelection", "/selections/1"},
      {"GetSelection", "/selections/1"}, {"DeleteSelection", "/selections/1"}};
  if (const auto it = kByField.find(path); it != kByField.end()) return of_scene + it->second;
  const auto it = kByMethod.find(method.name());
  return it == kByMethod.end() ? of_scene : of_scene + it->second;
}

bool NamesAJob(const MethodDescriptor& method) {
  return method.name() == "GetJob" || method.name() == "CancelJob" || method.name() == "WatchJob";
}

void SetPath(Message& request, const std::string& path, const std::string& value) {
  Message* message = &request;
  for (const std::string& part : std::vector<std::string>(absl::StrSplit(path, '.'))) {
    const FieldDescriptor* field = message->GetDescriptor()->FindFieldByName(part);
    ASSERT_NE(field, nullptr) << path;
    if (field->message_type() == nullptr) {
      message->GetReflection()->SetString(message, field, value);
    } else {
      message = message->GetReflection()->MutableMessage(message, field);
    }
  }
}

struct AccessMatrix : KeyedServer {
  using Request = std::unique_ptr<Message>;

  // Returns a request whose resources are all of `scene`, except the one at `odd`, which is of
  // `odd_scene`.
  Request MakeRequest(const MethodDescriptor& method, const std::string& scene, int odd = -1,
                      const std::string& odd_scene = "") {
    Request request(google::protobuf::MessageFactory::generated_factory()
                        ->GetPrototype(method.input_type())
                        ->New());
    const v1::Access& option = method.options().GetExtension(v1::access);
    for (int i = 0; i < option.resources_size(); ++i) {
      const std::string& of = i == odd ? odd_scene : scene;
      const std::string& path = option.resources(i);
      if (NamesAJob(method)) {
        SetPath(*request, path, of == "shelf" ? job : "jobs/j999");
      } else {
        SetPath(*request, path, NameFor(method, path, of));
      }
    }
    return request;
  }
  grpc::Status AskFor(const MethodDescriptor& method, const Message& request,
                      const std::string& secret) {
    return Ask(method.full_name(), request, secret);
  }
  // Returns all methods; those that delete resources come last.
  static std::vector<const MethodDescriptor*> Ordered() {
    auto methods = testing::AllMethods();
    std::stable_sort(methods.begin(), methods.end(), [](const auto* a, const auto* b) {
      const auto rank = [](const MethodDescriptor* method) {
        return method->name() == "DeleteScene" ? 2 : method->name().rfind("Delete", 0) == 0 ? 1 : 0;
      };
      return rank(a) < rank(b);
    });
    return methods;
  }
};

bool IsRefusal(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::UNAUTHENTICATED ||
         status.error_code() == grpc::StatusCode::PERMISSION_DENIED;
}

void ExpectReason(const grpc::Status& status, grpc::StatusCode code, const std::string& reason) {
  EXPECT_EQ(status.error_code(), code) << status.error_message();
  EXPECT_EQ(DetailOf(status).reason(), reason) << status.error_message();
}

void ExpectByScope(const grpc::Status& status, const v1::Access& option,
                   const std::vector<v1::Scope>& scopes) {
  if (std::find(scopes.begin(), scopes.end(), option.scope()) != scopes.end()) {
    EXPECT_FALSE(IsRefusal(status)) << status.error_message();
    return;
  }
  ExpectReason(status, grpc::StatusCode::PERMISSION_DENIED, "MISSING_SCOPE");
  EXPECT_EQ(DetailOf(status).limit(), v1::Scope_Name(option.scope()));
}

TEST_F(AccessMatrix, EveryMethodAnswersEveryKeyAsItsOptionSays) {
  for (const MethodDescriptor* method : Ordered()) {
    SCOPED_TRACE(method->full_name());
    const v1::Access& option = method->options().GetExtension(v1::access);
    const auto request = MakeRequest(*method, "shelf");
    ExpectReason(AskFor(*method, *request, nobody), grpc::StatusCode::UNAUTHENTICATED, "NO_KEY");
    ExpectReason(AskFor(*method, *request, "pk_x"), grpc::StatusCode::UNAUTHENTICATED, "BAD_KEY");
    ExpectByScope(AskFor(*method, *request, reader), option, {v1::SCOPE_READ});
    ExpectByScope(AskFor(*method, *request, operates), option, {v1::SCOPE_OPERATE});
    const grpc::Status others = AskFor(*method, *request, stranger);
    if (option.scope() != v1::SCOPE_OPERATE && option.resources_size() > 0) {
      ExpectReason(others, grpc::StatusCode::PERMISSION_DENIED, "NOT_YOURS");
    } else {
      ExpectByScope(others, option, {v1::SCOPE_READ, v1::SCOPE_WRITE, v1::SCOPE_TRAIN});
    }
    ExpectByScope(AskFor(*method, *request, full), option,
                  {v1::SCOPE_READ, v1::SCOPE_WRITE, v1::SCOPE_TRAIN});
  }
}

TEST_F(AccessMatrix, ChecksEveryNamedResourceWithoutRevealingWhetherItExists) {
  int num_fields = 0;
  // For the stranger the scene "shelf" is of another project; its own is "annex".
  v1::CreateSceneRequest create;
  create.set_scene_id("annex");
  ASSERT_OK(Ask("pepeseg.v1.SceneService.CreateScene", create, stranger));
  for (const MethodDescriptor* method : Ordered()) {
    SCOPED_TRACE(method->full_name());
    const v1::Access& option = method->options().GetExtension(v1::access);
    for (int i = 0; i < option.resources_size(); ++i) {
      SCOPED_TRACE(option.resources(i));
      ++num_fields;
      const auto others = AskFor(*method, *MakeRequest(*method, "annex", i, "shelf"), stranger);
      const auto none = AskFor(*method, *MakeRequest(*method, "annex", i, "nowhere"), stranger);
      ExpectReason(others, grpc::StatusCode::PERMISSION_DENIED, "NOT_YOURS");
      EXPECT_EQ(others.error_code(), none.error_code());
      EXPECT_EQ(others.error_message(), none.error_message());
      EXPECT_EQ(others.error_details(), none.error_details());
    }
  }
  EXPECT_GE(num_fields, 35);
  // None of these calls has changed the scene.
  v1::GetSceneRequest get;
  get.set_name("scenes/shelf");
  EXPECT_OK(Ask("pepeseg.v1.SceneService.GetScene", get, full));
}

// Returns `status` as it would be if the scene were called "free".
std::string Renamed(const grpc::Status& status, const std::string& scene) {
  if (status.ok()) return "OK";
  return absl::StrReplaceAll(absl::StrCat(status.error_code(), " ", status.error_message(), " ",
                                          DetailOf(status).ShortDebugString()),
                             {{"scenes/" + scene, "scenes/free"}});
}

// For the stranger an id that another project uses is free: its own scene with that id is empty,
// whatever the other's contains.
TEST_F(AccessMatrix, AnswersTheSameForAFreeIdAndOneOfAnotherProject) {
  for (const char* id : {"shelf", "free"}) {
    v1::CreateSceneRequest create;
    create.set_scene_id(id);
    EXPECT_OK(Ask("pepeseg.v1.SceneService.CreateScene", create, stranger));
    EXPECT_ERROR(Ask("pepeseg.v1.SceneService.CreateScene", create, stranger), grpc::ALREADY_EXISTS,
                 {.resource = absl::StrCat("scenes/", id)});
  }
  int num_methods = 0;
  for (const MethodDescriptor* method : Ordered()) {
    SCOPED_TRACE(method->full_name());
    const v1::Access& option = method->options().GetExtension(v1::access);
    if (NamesAJob(*method) || option.resources_size() == 0) continue;
    ++num_methods;
    const auto taken = AskFor(*method, *MakeRequest(*method, "shelf"), stranger);
    const auto free = AskFor(*method, *MakeRequest(*method, "free"), stranger);
    EXPECT_EQ(Renamed(taken, "shelf"), Renamed(free, "free"));
    EXPECT_EQ(taken.error_message().find('@'), std::string::npos) << taken.error_message();
  }
  EXPECT_GE(num_methods, 20);
  // The last of these calls deletes the stranger's scene; the other project's is unchanged.
  v1::GetModelRequest get;
  get.set_name("scenes/shelf/models/1");
  EXPECT_OK(Ask("pepeseg.v1.SceneService.GetModel", get, full));
  v1::GetSceneRequest gone;
  gone.set_name("scenes/shelf");
  ExpectReason(Ask("pepeseg.v1.SceneService.GetScene", gone, stranger),
               grpc::StatusCode::PERMISSION_DENIED, "NOT_YOURS");
}

TEST_F(AccessMatrix, RefusesKeysOfScenesAsNames) {
  v1::CreateSceneRequest create;
  create.set_scene_id("shelf");
  ASSERT_OK(Ask("pepeseg.v1.SceneService.CreateScene", create, stranger));
  for (const char* name : {"scenes/1@shelf", "scenes/0@shelf", "projects/other/scenes/shelf"}) {
    v1::GetSceneRequest get;
    get.set_name(name);
    for (const std::string& secret : {stranger, full}) {
      EXPECT_ERROR(Ask("pepeseg.v1.SceneService.GetScene", get, secret), grpc::INVALID_ARGUMENT)
          << name;
    }
  }
}

TEST_F(AccessMatrix, ReportsMalformedNamesAfterKeyAndScope) {
  for (const MethodDescriptor* method : Ordered()) {
    SCOPED_TRACE(method->full_name());
    const v1::Access& option = method->options().GetExtension(v1::access);
    if (option.resources_size() == 0) continue;
    const auto request = MakeRequest(*method, "shelf");
    SetPath(*request, option.resources(0), "NONSENSE");
    ExpectReason(AskFor(*method, *request, nobody), grpc::StatusCode::UNAUTHENTICATED, "NO_KEY");
    if (method->client_streaming() && method->server_streaming())
      continue;  // the error comes as a message
    EXPECT_ERROR(AskFor(*method, *request, full), grpc::INVALID_ARGUMENT);
  }
}

}  // namespace
}  // namespace pepeseg
