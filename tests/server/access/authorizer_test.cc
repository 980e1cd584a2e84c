#include "server/access/authorizer.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "pepeseg/v1/admin_service.pb.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"
#include "server/access/api_key.h"
#include "server/store/error_detail.h"
#include "tests/server/store/scene_of.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

constexpr int kEverythingOfAProject = 0b1110;  // read, write, train

v1::GetSceneRequest Get(const std::string& name) {
  v1::GetSceneRequest request;
  request.set_name(name);
  return request;
}

class AuthorizerTest : public ::testing::Test {
 protected:
  AuthorizerTest()
      : store_(*Store::Open("sqlite::memory:")),
        audit_(*AuditLog::Open(path_, {})),
        refusals_(*RefusalLog::Open(refused_path_, {})) {
    CreateScene("mine", "lab");
    CreateScene("theirs", "other");
  }
  void CreateScene(const std::string& id, const std::string& project) {
    EXPECT_OK(store_->scenes().CreateScene(NewScene(id, "", "", project)));
  }
  CallOrigin With(const std::string& header) { return {"test", {header}}; }
  // Creates a key of the project "lab".
  CallOrigin Key(int scopes, absl::Time expire_time = absl::InfinitePast()) {
    NewKey key = *MakeKey();
    key.record.project = "lab";
    key.record.scopes = scopes;
    key.record.expire_time = expire_time;
    EXPECT_OK(store_->keys().CreateKey(key.record));
    key_ = key;
    return With(absl::StrCat("Bearer ", key.secret));
  }
  nlohmann::json LastLine() { return LastLineOf(path_); }
  nlohmann::json LastRefusal() { return LastLineOf(refused_path_); }
  static nlohmann::json LastLineOf(const std::filesystem::path& path) {
    std::ifstream file(path);
    std::string line, last;
    while (std::getline(file, line)) last = line;
    return last.empty() ? nlohmann::json() : nlohmann::json::parse(last);
  }

  testing::TempFolder folder_;
  std::filesystem::path path_ = folder_ / "audit.log";
  std::filesystem::path refused_path_ = folder_ / "refused.log";
  std::unique_ptr<Store> store_;
  std::unique_ptr<AuditLog> audit_;
  std::unique_ptr<RefusalLog> refusals_;
  Authorizer authorizer_{store_.get(), audit_.get(), refusals_.get(),
                         /*require_keys=*/true};
  NewKey key_;
};

TEST_F(AuthorizerTest, AllowsAKeyItsProject) {
  const CallOrigin origin = Key(kEverythingOfAProject);
  ASSERT_OK_AND_ASSIGN(const auto caller, authorizer_.Authorize(origin, Get("scenes/mine")));
  EXPECT_EQ(caller.project, "lab");
  EXPECT_EQ(caller.key, key_.record.id);
  EXPECT_EQ(caller.scopes, kEverythingOfAProject);
  EXPECT_EQ(caller.visible_project(), "lab");
  const CallOrigin lower = With(absl::StrCat("bearer ", key_.secret));
  EXPECT_OK(authorizer_.Authorize(lower, Get("scenes/mine")));
}

TEST_F(AuthorizerTest, GivesTheSameAnswerToEveryInvalidKey) {
  const auto no_key = authorizer_.Authorize({"test", {}}, Get("scenes/mine")).status();
  EXPECT_TRUE(absl::IsUnauthenticated(no_key)) << no_key;
  EXPECT_EQ(DetailOf(no_key).reason, "NO_KEY");
  EXPECT_EQ(LastRefusal()["reason"], "NO_KEY");

  const auto unknown =
      authorizer_.Authorize(With(absl::StrCat("Bearer ", MakeKey()->secret)), Get("scenes/mine"));
  EXPECT_TRUE(absl::IsUnauthenticated(unknown.status())) << unknown.status();
  EXPECT_EQ(DetailOf(unknown.status()).reason, "BAD_KEY");
  EXPECT_EQ(LastRefusal()["reason"], "UNKNOWN_KEY");
  EXPECT_EQ(LastRefusal()["project"], "");

  const CallOrigin expired = Key(AllScopes(), absl::Now() - absl::Seconds(1));
  EXPECT_EQ(authorizer_.Authorize(expired, Get("scenes/mine")).status(), unknown.status());
  EXPECT_EQ(LastRefusal()["reason"], "EXPIRED_KEY");
  EXPECT_EQ(LastRefusal()["key"], key_.record.id);

  const CallOrigin revoked = Key(AllScopes());
  ASSERT_OK(authorizer_.Authorize(revoked, Get("scenes/mine")));
  ASSERT_OK(store_->keys().RevokeKey(key_.record.id));
  EXPECT_EQ(authorizer_.Authorize(revoked, Get("scenes/mine")).status(), unknown.status());
  EXPECT_EQ(LastRefusal()["reason"], "REVOKED_KEY");
  EXPECT_TRUE(LastLine().is_null());  // the audit log has none of them
}

// Anybody who can reach the server can cause any number of refusals.
TEST_F(AuthorizerTest, KeepsRefusalsOfUnknownCallersOutOfTheAuditLog) {
  v1::DeleteSceneRequest remove;
  remove.set_name("scenes/mine");
  ASSERT_OK(
      authorizer_.Run(Key(AllScopes()), remove, [](const Caller&) { return absl::OkStatus(); }));
  const auto size = std::filesystem::file_size(path_);
  for (int i = 0; i < 3000; ++i) {
    EXPECT_FALSE(authorizer_.Authorize({"test", {}}, Get("scenes/mine")).ok());
  }
  EXPECT_EQ(std::filesystem::file_size(path_), size);
  EXPECT_LT(std::filesystem::file_size(refused_path_), 1000u * 200);
  // Refusals of callers with a valid key are in the audit log.
  EXPECT_FALSE(authorizer_.Authorize(Key(AllScopes()), Get("scenes/theirs")).ok());
  EXPECT_EQ(LastLine()["reason"], "NOT_YOURS");
}

TEST_F(AuthorizerTest, RefusesMalformedHeaders) {
  const CallOrigin good = Key(AllScopes());
  for (const std::string& header :
       {std::string(), std::string("Bearer"), std::string("Bearer "), key_.secret,
        absl::StrCat("Basic ", key_.secret), absl::StrCat("Bearer  ", key_.secret),
        absl::StrCat("Bearer ", key_.secret, " "), absl::StrCat("Bearer ", key_.secret, "x"),
        absl::StrCat("Bearer ", std::string(100'000, 'x')), std::string("Bearer pk_' OR 1=1 --")}) {
    const auto refused = authorizer_.Authorize(With(header), Get("scenes/mine"));
    EXPECT_TRUE(absl::IsUnauthenticated(refused.status())) << header.substr(0, 80);
  }
  CallOrigin twice = good;
  twice.authorization.push_back(good.authorization[0]);
  EXPECT_TRUE(absl::IsUnauthenticated(authorizer_.Authorize(twice, Get("scenes/mine")).status()));
}

TEST_F(AuthorizerTest, ReportsAMissingScopeBeforeLookingAtTheRequest) {
  const CallOrigin reader = Key(ScopeBit(v1::SCOPE_READ));
  v1::DeleteSceneRequest remove;
  for (const char* name : {"scenes/mine", "scenes/theirs", "scenes/nowhere", "NONSENSE", ""}) {
    remove.set_name(name);
    const auto refused = authorizer_.Authorize(reader, remove);
    EXPECT_TRUE(absl::IsPermissionDenied(refused.status())) << name;
    EXPECT_EQ(DetailOf(refused.status()).reason, "MISSING_SCOPE");
    EXPECT_EQ(DetailOf(refused.status()).limit, "SCOPE_WRITE");
  }
  // No scope implies another.
  const CallOrigin operates = Key(ScopeBit(v1::SCOPE_OPERATE));
  EXPECT_FALSE(authorizer_.Authorize(operates, Get("scenes/mine")).ok());
  EXPECT_OK(authorizer_.Authorize(operates, v1::ListKeysRequest()));
  v1::LoadModelRequest load;
  load.set_name("scenes/theirs/models/1");
  EXPECT_OK(authorizer_.Authorize(operates, load));
}

TEST_F(AuthorizerTest, AnswersTheSameForScenesOfOthersAndMissingOnes) {
  const CallOrigin origin = Key(kEverythingOfAProject);
  const auto others = authorizer_.Authorize(origin, Get("scenes/theirs")).status();
  const auto none = authorizer_.Authorize(origin, Get("scenes/nowhere")).status();
  EXPECT_TRUE(absl::IsPermissionDenied(others)) << others;
  EXPECT_EQ(DetailOf(others).reason, "NOT_YOURS");
  EXPECT_EQ(others, none);
  v1::TrainSceneRequest train;
  train.set_scene("scenes/mine");
  train.set_dataset("scenes/theirs/datasets/1");
  EXPECT_TRUE(absl::IsPermissionDenied(authorizer_.Authorize(origin, train).status()));
  v1::GetJobRequest job;
  job.set_name("jobs/j12");
  EXPECT_TRUE(absl::IsPermissionDenied(authorizer_.Authorize(origin, job).status()));
  // Malformed names are left to the handler.
  for (const char* name : {"", "scenes/", "scenes/_under", "mine", "scenes", "jobs/x", "jobs/j0"}) {
    EXPECT_OK(authorizer_.Authorize(origin, Get(name))) << name;
  }
}

TEST_F(AuthorizerTest, NoticesASceneThatAnotherProjectCreatedAgain) {
  const CallOrigin origin = Key(kEverythingOfAProject);
  ASSERT_OK(authorizer_.Authorize(origin, Get("scenes/mine")));
  ASSERT_OK(store_->scenes().DeleteScene(SceneOf(*store_, "mine")));
  EXPECT_FALSE(authorizer_.Authorize(origin, Get("scenes/mine")).ok());
  CreateScene("mine", "other");
  EXPECT_FALSE(authorizer_.Authorize(origin, Get("scenes/mine")).ok());
}

TEST_F(AuthorizerTest, AllowsEverythingWithoutKeys) {
  Authorizer open(store_.get(), audit_.get(), refusals_.get(), /*require_keys=*/false);
  for (const char* name : {"scenes/mine", "scenes/theirs", "scenes/nowhere"}) {
    ASSERT_OK_AND_ASSIGN(const auto caller, open.Authorize({"test", {}}, Get(name)));
    EXPECT_EQ(caller.project, "default");
    EXPECT_EQ(caller.visible_project(), "");
    EXPECT_EQ(caller.scopes, AllScopes());
  }
}

TEST_F(AuthorizerTest, RecordsCallsThatChangeSomething) {
  const CallOrigin origin = Key(AllScopes());
  const auto done = [](const Caller&) { return absl::OkStatus(); };
  ASSERT_OK(authorizer_.Run(origin, Get("scenes/mine"), done));
  EXPECT_TRUE(LastLine().is_null());  // a call that only reads
  v1::DeleteSceneRequest remove;
  remove.set_name("scenes/mine");
  ASSERT_OK(authorizer_.Run(origin, remove, done));
  EXPECT_EQ(LastLine()["method"], "pepeseg.v1.SceneService.DeleteScene");
  EXPECT_EQ(LastLine()["resources"], nlohmann::json({"scenes/mine"}));
  EXPECT_EQ(LastLine()["key"], key_.record.id);
  EXPECT_EQ(LastLine()["project"], "lab");
  EXPECT_EQ(LastLine()["peer"], "test");
  EXPECT_EQ(LastLine()["outcome"], "OK");
  v1::CreateSceneRequest create;
  create.set_scene_id("new");
  const auto fails = [](const Caller&) { return absl::AlreadyExistsError("taken"); };
  EXPECT_TRUE(absl::IsAlreadyExists(authorizer_.Run(origin, create, fails)));
  EXPECT_EQ(LastLine()["outcome"], "ALREADY_EXISTS");
  EXPECT_EQ(LastLine()["resources"], nlohmann::json({"new"}));
  ASSERT_OK(authorizer_.Run(origin, v1::ListResidentModelsRequest(), done));
  EXPECT_EQ(LastLine()["method"], "pepeseg.v1.AdminService.ListResidentModels");
  std::ifstream file(path_);
  const std::string all((std::istreambuf_iterator<char>(file)), {});
  EXPECT_EQ(all.find(key_.secret), std::string::npos);
  EXPECT_EQ(all.find(key_.record.sha256), std::string::npos);
}

// A server that is killed during the call leaves this line.
TEST_F(AuthorizerTest, RecordsAChangeBeforeItIsMade) {
  const CallOrigin origin = Key(AllScopes());
  v1::DeleteSceneRequest remove;
  remove.set_name("scenes/mine");
  nlohmann::json begun;
  ASSERT_OK(authorizer_.Run(origin, remove, [&](const Caller&) {
    begun = LastLine();
    return absl::OkStatus();
  }));
  EXPECT_EQ(begun["method"], "pepeseg.v1.SceneService.DeleteScene");
  EXPECT_EQ(begun["resources"], nlohmann::json({"scenes/mine"}));
  EXPECT_EQ(begun["outcome"], "BEGUN");
  EXPECT_EQ(LastLine()["outcome"], "OK");
  EXPECT_EQ(LastLine()["call"], begun["call"]);
  // Operators' calls that only read have one line.
  ASSERT_OK(authorizer_.Run(origin, v1::ListResidentModelsRequest(), [&](const Caller&) {
    EXPECT_EQ(LastLine()["call"], begun["call"]);
    return absl::OkStatus();
  }));
  EXPECT_FALSE(LastLine().contains("call"));
}

TEST_F(AuthorizerTest, DoesNotRunRefusedCalls) {
  bool ran = false;
  const auto note = [&](const Caller&) {
    ran = true;
    return absl::OkStatus();
  };
  EXPECT_FALSE(authorizer_.Run({"test", {}}, Get("scenes/mine"), note).ok());
  EXPECT_FALSE(authorizer_.Run(Key(AllScopes()), Get("scenes/theirs"), note).ok());
  EXPECT_FALSE(ran);
}

}  // namespace
}  // namespace pepeseg
