#include "server/access/gateway_identity.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "pepeseg/v1/scene_service.pb.h"
#include "server/access/api_key.h"
#include "server/access/authorizer.h"
#include "server/store/error_detail.h"
#include "tests/server/store/scene_of.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

GatewayMetadata Says(const std::string& project, const std::string& scopes,
                     const std::string& subject) {
  return {{project}, {scopes}, {subject}, true, {}};
}

TEST(ReadGatewayIdentity, ReadsProjectScopesAndSubject) {
  ASSERT_OK_AND_ASSIGN(const auto caller,
                       ReadGatewayIdentity(Says("lab", "read,train", "ann@example.org")));
  EXPECT_EQ(caller.project, "lab");
  EXPECT_EQ(caller.scopes, ScopeBit(v1::SCOPE_READ) | ScopeBit(v1::SCOPE_TRAIN));
  EXPECT_EQ(caller.subject, "ann@example.org");
}

TEST(ReadGatewayIdentity, RefusesMissingRepeatedAndMalformedValues) {
  const GatewayMetadata good = Says("lab", "read", "ann");
  std::vector<GatewayMetadata> bad = {
      Says("", "read", "ann"),        Says("Lab", "read", "ann"),
      Says("lab/..", "read", "ann"),  Says("-lab", "read", "ann"),
      Says("lab", "", "ann"),         Says("lab", "read,", "ann"),
      Says("lab", "read write", "a"), Says("lab", "READ", "ann"),
      Says("lab", "read", ""),        Says("lab", "read", "a b"),
      Says("lab", "read", "a\n"),     Says("lab", "read", std::string(129, 'a')),
      Says("lab", "operate", "ann"),  Says("lab", "read,operate", "ann"),
  };
  for (int i = 0; i < 3; ++i) {
    for (const bool twice : {false, true}) {
      GatewayMetadata gateway = good;
      auto& values = i == 0 ? gateway.projects : i == 1 ? gateway.scopes : gateway.subjects;
      twice ? values.push_back(values[0]) : values.clear();
      bad.push_back(gateway);
    }
  }
  for (const GatewayMetadata& gateway : bad) {
    EXPECT_TRUE(absl::IsInvalidArgument(ReadGatewayIdentity(gateway).status()))
        << absl::StrCat(gateway.projects.size(), gateway.scopes.size(), gateway.subjects.size());
  }
}

class GatewayCallTest : public ::testing::Test {
 protected:
  GatewayCallTest() {
    for (const auto& [id, project] : {std::pair("mine", "lab"), std::pair("theirs", "other")}) {
      EXPECT_OK(store_->scenes().CreateScene(NewScene(id, "", "", project)));
    }
  }
  // Returns a call over a connection with this certificate.
  static CallOrigin From(const std::vector<std::string>& certificate, GatewayMetadata gateway) {
    gateway.certificate_names = certificate;
    return {"test", {}, std::move(gateway)};
  }
  // Returns the reason of a refusal, "" for OK.
  static std::string ReasonOf(const absl::Status& status) { return DetailOf(status).reason; }
  static v1::GetSceneRequest Get(const std::string& name) {
    v1::GetSceneRequest request;
    request.set_name(name);
    return request;
  }
  nlohmann::json LastLine() { return LastLineOf(path_); }
  static nlohmann::json LastLineOf(const std::filesystem::path& path) {
    std::ifstream file(path);
    std::string line, last;
    while (std::getline(file, line)) last = line;
    return last.empty() ? nlohmann::json() : nlohmann::json::parse(last);
  }

  testing::TempFolder folder_;
  std::filesystem::path path_ = folder_ / "audit.log";
  std::unique_ptr<Store> store_ = *Store::Open("sqlite::memory:");
  std::unique_ptr<AuditLog> audit_ = *AuditLog::Open(path_, {});
  std::filesystem::path refused_path_ = folder_ / "refused.log";
  std::unique_ptr<RefusalLog> refusals_ = *RefusalLog::Open(refused_path_, {});
  Authorizer authorizer_{store_.get(), audit_.get(), refusals_.get(),
                         /*require_keys=*/true, "gateway"};
  const GatewayMetadata ann_ = Says("lab", "read", "ann");
};

TEST_F(GatewayCallTest, IsAllowedInItsProjectByItsScopes) {
  const CallOrigin origin = From({"gateway"}, ann_);
  ASSERT_OK_AND_ASSIGN(const auto caller, authorizer_.Authorize(origin, Get("scenes/mine")));
  EXPECT_EQ(caller.project, "lab");
  EXPECT_EQ(caller.subject, "ann");
  EXPECT_EQ(caller.key, "");
  EXPECT_EQ(caller.visible_project(), "lab");
  EXPECT_EQ(ReasonOf(authorizer_.Authorize(origin, Get("scenes/theirs")).status()), "NOT_YOURS");
  EXPECT_EQ(LastLine()["subject"], "ann");
  EXPECT_EQ(LastLine()["project"], "lab");
  v1::DeleteSceneRequest remove;
  remove.set_name("scenes/mine");
  EXPECT_EQ(ReasonOf(authorizer_.Authorize(origin, remove).status()), "MISSING_SCOPE");
  const CallOrigin by_alternative_name = From({"localhost", "gateway"}, ann_);
  EXPECT_OK(authorizer_.Authorize(by_alternative_name, Get("scenes/mine")));
}

TEST_F(GatewayCallTest, IsRefusedUnlessItComesFromTheTrustedGateway) {
  const std::vector<std::vector<std::string>> others = {
      {}, {""}, {"gateway2"}, {"a.gateway"}, {"Gateway"}, {"localhost", "127.0.0.1"}};
  for (const auto& certificate : others) {
    const auto refused = authorizer_.Authorize(From(certificate, ann_), Get("scenes/mine"));
    EXPECT_TRUE(absl::IsUnauthenticated(refused.status())) << refused.status();
    EXPECT_EQ(ReasonOf(refused.status()), "NOT_A_GATEWAY");
    EXPECT_TRUE(LastLine().is_null());
    const nlohmann::json refusal = LastLineOf(refused_path_);
    EXPECT_EQ(refusal["reason"], "NOT_A_GATEWAY");
    EXPECT_FALSE(refusal.contains("subject")) << "the caller's identity was not verified";
    EXPECT_EQ(refusal["project"], "");
  }
  Authorizer trusts_nobody(store_.get(), audit_.get(), refusals_.get(),
                           /*require_keys=*/true);
  EXPECT_EQ(ReasonOf(trusts_nobody.Authorize(From({""}, ann_), Get("scenes/mine")).status()),
            "NOT_A_GATEWAY");
  EXPECT_EQ(ReasonOf(trusts_nobody.Authorize(From({"gateway"}, ann_), Get("scenes/mine")).status()),
            "NOT_A_GATEWAY");
  Authorizer asks_nobody(store_.get(), audit_.get(), refusals_.get(),
                         /*require_keys=*/false, "gateway");
  EXPECT_EQ(ReasonOf(asks_nobody.Authorize(From({"gateway"}, ann_), Get("scenes/mine")).status()),
            "NOT_A_GATEWAY");
}

TEST_F(GatewayCallTest, IsRefusedWithAKeyOrWhenIncomplete) {
  NewKey key = *MakeKey();
  key.record.project = "lab";
  key.record.scopes = AllScopes();
  ASSERT_OK(store_->keys().CreateKey(key.record));
  CallOrigin both = From({"gateway"}, ann_);
  both.authorization = {absl::StrCat("Bearer ", key.secret)};
  EXPECT_EQ(ReasonOf(authorizer_.Authorize(both, Get("scenes/mine")).status()), "BAD_VOUCHING");
  GatewayMetadata other_metadata;
  other_metadata.present = true;
  const auto refused = authorizer_.Authorize(From({"gateway"}, other_metadata), Get("scenes/mine"));
  EXPECT_TRUE(absl::IsUnauthenticated(refused.status())) << refused.status();
  EXPECT_EQ(ReasonOf(refused.status()), "BAD_VOUCHING");
  both.gateway = {};  // the gateway forwards a client's key
  EXPECT_OK(authorizer_.Authorize(both, Get("scenes/mine")));
}

}  // namespace
}  // namespace pepeseg
