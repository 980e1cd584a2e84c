// Calls that the gateway passes on, and its answers to those that it refuses.
#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>

#include <chrono>
#include <set>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "pepeseg/v1/errors.pb.h"
#include "server/store/error_detail.h"
#include "tests/system/gateway/gateway_fixture.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

std::string ReasonOf(const grpc::Status& status) {
  v1::Status details;
  return details.ParseFromString(status.error_details()) ? UnpackDetail(details.details()).reason
                                                         : "";
}

// Calls any method, without a message.
grpc::Status Ask(const std::shared_ptr<grpc::Channel>& channel, const std::string& path) {
  grpc::GenericStub stub(channel);
  const grpc::Slice nothing("");
  grpc::CompletionQueue queue;
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
  const auto call = stub.PrepareUnaryCall(&context, path, grpc::ByteBuffer(&nothing, 1), &queue);
  call->StartCall();
  grpc::ByteBuffer answer;
  grpc::Status status;
  call->Finish(&answer, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  return status;
}

TEST_F(GatewayTest, GrantsWhatTheClaimsOfAJwtSay) {
  EXPECT_EQ(TextOf(CreateScene(Token("read write"), "mine")), "OK: ");
  EXPECT_EQ(TextOf(GetScene(Token("openid read"), "mine")), "OK: ");
  EXPECT_EQ(ReasonOf(CreateScene(Token("read"), "other")), "MISSING_SCOPE");
  const std::string stranger = fleet().issuer.Sign(TokenIssuer::Claims("elsewhere", "read write"));
  EXPECT_EQ(ReasonOf(GetScene(stranger, "mine")), "NOT_YOURS");
  auto to_many = TokenIssuer::Claims("lab", "read");
  to_many["aud"] = {"somebody", "pepeseg"};
  EXPECT_EQ(TextOf(GetScene(fleet().issuer.Sign(to_many), "mine")), "OK: ");
  const auto by_next_key = fleet().next_issuer.Sign(TokenIssuer::Claims("lab", "read"));
  EXPECT_EQ(TextOf(GetScene(by_next_key, "mine")), "OK: ");
  EXPECT_THAT(fleet().ReadAudit(), HasSubstr(R"("subject":"ann@example.org","project":"lab")"));
}

TEST_F(GatewayTest, PassesAKeyToTheServer) {
  const std::string reader = fleet().MakeKey("lab", {v1::SCOPE_READ});
  EXPECT_EQ(TextOf(List(reader)), "OK: ");
  EXPECT_EQ(ReasonOf(CreateScene(reader, "by-key")), "MISSING_SCOPE");
  EXPECT_EQ(ReasonOf(List("pk_" + std::string(43, 'a'))), "BAD_KEY");
}

TEST_F(GatewayTest, RemovesIdentityHeadersOfClients) {
  const Metadata claims = {{"x-pepeseg-project", "other"},
                           {"x-pepeseg-scopes", "read"},
                           {"x-pepeseg-subject", "eve"},
                           {"x-pepeseg-anything", "x"}};
  // The gateway removes them. The server would refuse them next to a key.
  EXPECT_EQ(TextOf(List(fleet().MakeKey("lab", {v1::SCOPE_READ}), claims)), "OK: ");
  EXPECT_EQ(TextOf(List(Token(), claims)), "OK: ");
  EXPECT_THAT(TextOf(List("", claims)), StartsWith("UNAUTHENTICATED: the gateway asks for"));
  EXPECT_THAT(fleet().ReadAudit(), Not(HasSubstr("eve")));
  // Directly to the server, with a valid certificate that is not the gateway's.
  const Metadata right(claims.begin(), claims.begin() + 3);
  const auto past = fleet().ConnectDirectly(0, "", fleet().clients.Issue("client"));
  EXPECT_EQ(ReasonOf(List(past, right)), "NOT_A_GATEWAY");
  EXPECT_EQ(TextOf(List(fleet().ConnectDirectly(0, ""), right)), "OK: ");
}

TEST_F(GatewayTest, RefusesInvalidClaimsWithAReason) {
  struct Case {
    const char* claim;
    nlohmann::json value;  // null: the claim is missing
    const char* answer;
  };
  const int64_t now = absl::ToUnixSeconds(absl::Now());
  const std::vector<Case> cases = {
      {"exp", now - 1, "UNAUTHENTICATED: the token has expired"},
      {"exp", 1e300, "UNAUTHENTICATED: the token"},
      {"exp", -1e300, "UNAUTHENTICATED: the token"},
      {"exp", "soon", "UNAUTHENTICATED: the token"},
      {"exp", nullptr, "UNAUTHENTICATED: the token does not say when it expires"},
      {"nbf", now + 100, "UNAUTHENTICATED: the token is not valid yet"},
      {"iss", "somebody", "UNAUTHENTICATED: the token is of an issuer"},
      {"iss", nullptr, "UNAUTHENTICATED: the token is of an issuer"},
      {"aud", "somebody", "UNAUTHENTICATED: the token is for somebody else"},
      {"aud", {"some", "body"}, "UNAUTHENTICATED: the token is for somebody else"},
      {"aud", nullptr, "UNAUTHENTICATED: the token is for somebody else"},
      {"sub", nullptr, "UNAUTHENTICATED: the token names no subject"},
      {"project", nullptr, "PERMISSION_DENIED: the token names no project"},
      {"project", "No Name", "PERMISSION_DENIED: the token names no project"},
      {"project", "lab\n", "PERMISSION_DENIED: the token names no project"},
      {"project", "lab\r\nx-pepeseg-scopes: operate", "PERMISSION_DENIED"},
      {"scope", nullptr, "PERMISSION_DENIED: the token has none of the scopes"},
      {"scope", "operate", "PERMISSION_DENIED: the token has none of the scopes"},
      {"scope", "reader writes", "PERMISSION_DENIED: the token has none of the scopes"},
  };
  for (const Case& wrong : cases) {
    auto claims = TokenIssuer::Claims("lab", "read");
    claims[wrong.claim] = wrong.value;
    if (wrong.value.is_null()) claims.erase(wrong.claim);
    EXPECT_THAT(TextOf(List(fleet().issuer.Sign(claims))), StartsWith(wrong.answer))
        << claims.dump();
  }
}

TEST_F(GatewayTest, RefusesUnsignedTokens) {
  const std::string payload = TokenIssuer::Claims("lab", "read").dump();
  const auto with = [&](const char* header, const std::string& signature) {
    return TokenIssuer::Assemble(header, payload, signature);
  };
  constexpr char kRs256[] = R"({"alg":"RS256"})";
  const std::string& key = fleet().issuer.public_key();
  const TokenIssuer other;
  const std::vector<std::string> bad = {
      other.Sign(TokenIssuer::Claims("lab", "read")),
      with(kRs256, std::string(256, 'x')),
      with(kRs256, "x"),
      with(kRs256, ""),
      with(R"({"alg":"none"})", ""),
      with(R"({"alg":"HS256"})", key.substr(0, 32)),
      with(R"({"alg":"rs256"})", fleet().issuer.Signature(kRs256, payload)),
      with("{}", "x"),
      "abc",
      "a.b.c",
      "..",
      std::string(3000, 'a'),
  };
  for (const std::string& token : bad) {
    EXPECT_THAT(TextOf(List(token)), StartsWith("UNAUTHENTICATED: the token is not signed by"))
        << token;
  }
  const Metadata basic = {{"authorization", "Basic pk_abc"}};
  EXPECT_THAT(TextOf(List("", basic)), StartsWith("UNAUTHENTICATED: the authorization is not"));
  const Metadata twice = {{"authorization", "Bearer pk_a"}, {"authorization", "Bearer pk_b"}};
  EXPECT_THAT(TextOf(List("", twice)), StartsWith("UNAUTHENTICATED: the call has more than one"));
}

// The gateway caches that a token's signature is good, not that the token is valid.
TEST_F(GatewayTest, ChecksAKnownTokenAgain) {
  constexpr char kHeader[] = R"({"alg":"RS256"})";
  auto claims = TokenIssuer::Claims("lab", "read");
  claims["exp"] = absl::ToUnixSeconds(absl::Now()) + 3;
  const std::string signature = fleet().issuer.Signature(kHeader, claims.dump());
  const std::string token = TokenIssuer::Assemble(kHeader, claims.dump(), signature);
  EXPECT_EQ(TextOf(List(token)), "OK: ");
  EXPECT_EQ(TextOf(List(token)), "OK: ");
  claims["project"] = "elsewhere";
  EXPECT_THAT(TextOf(List(TokenIssuer::Assemble(kHeader, claims.dump(), signature))),
              StartsWith("UNAUTHENTICATED: the token is not signed by"));
  absl::SleepFor(absl::Seconds(4));
  EXPECT_THAT(TextOf(List(token)), StartsWith("UNAUTHENTICATED: the token has expired"));
}

// In HAProxy 2.6 the error of a wrong signature ended the connection of the next client.
TEST_F(GatewayTest, KeepsConnectionsDespiteForgedTokens) {
  const std::string forged = TokenIssuer().Sign(TokenIssuer::Claims("lab", "read"));
  const auto forger = fleet().Connect(forged);
  const auto by_next_key =
      fleet().Connect(fleet().next_issuer.Sign(TokenIssuer::Claims("lab", "read")));
  std::vector<std::shared_ptr<grpc::Channel>> others;
  for (int i = 0; i < 6; ++i) {
    auto claims = TokenIssuer::Claims("lab", "read");
    claims["sub"] = absl::StrCat("other", i);
    others.push_back(fleet().Connect(fleet().issuer.Sign(claims)));
    EXPECT_OK(List(others.back()));
  }
  for (int round = 0; round < 12; ++round) {
    EXPECT_EQ(List(forger).error_code(), grpc::UNAUTHENTICATED);
    EXPECT_EQ(TextOf(List(by_next_key)), "OK: ");  // not signed by the first key
    for (const auto& other : others) EXPECT_EQ(TextOf(List(other)), "OK: ") << round;
  }
}

TEST_F(GatewayTest, RefusesCallsOverTheLimitUntilTheWindowEnds) {
  const std::string key = fleet().MakeKey("lab", {v1::SCOPE_READ});
  const std::map<std::string, int> answers = ListAtOnce(key, 101);
  ASSERT_EQ(answers.size(), 2u);
  EXPECT_EQ(answers.at("OK: "), 100);
  EXPECT_THAT(answers.rbegin()->first,
              StartsWith("RESOURCE_EXHAUSTED: more than 100 calls in 2s, which is"));
  EXPECT_EQ(TextOf(List(fleet().MakeKey("lab", {v1::SCOPE_READ}))), "OK: ") << "another key";
  absl::SleepFor(absl::Seconds(4.5));
  EXPECT_EQ(TextOf(List(key)), "OK: ");
}

TEST_F(GatewayTest, LimitsHeaders) {
  EXPECT_THAT(TextOf(List(Token(), {{"x-more", std::string(9 << 10, 'x')}})),
              AllOf(StartsWith("RESOURCE_EXHAUSTED: "), HasSubstr("8192 bytes")));
  EXPECT_EQ(TextOf(List(Token(), {{"x-more", std::string(6 << 10, 'x')}})), "OK: ");
}

TEST_F(GatewayTest, HidesAdminServiceAndReflection) {
  const auto channel = fleet().Connect(fleet().MakeKey("lab", {v1::SCOPE_OPERATE}));
  for (const char* path :
       {"/pepeseg.v1.AdminService/GetServerStatus", "/pepeseg.v1.AdminService/DrainServer",
        "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
        "/grpc.health.v1.Health/Watch", "/", "/pepeseg.v1.Nothing/X"}) {
    EXPECT_THAT(TextOf(Ask(channel, path)), StartsWith("UNIMPLEMENTED: the gateway knows no"))
        << path;
  }
  EXPECT_OK(Ask(fleet().Connect(""), "/grpc.health.v1.Health/Check"));
}

TEST_F(GatewayTest, LogsALinePerCallWithoutSecrets) {
  const size_t before = fleet().LogSize();
  const std::string token = Token();
  EXPECT_OK(List(token, {{"x-scene", "shelf"}, {"x-request-id", "mine-1"}}));
  EXPECT_FALSE(List("", {{"x-scene", "\"}{ \\"}}).ok());
  std::vector<nlohmann::json> lines;
  ASSERT_TRUE(testing::Eventually([&] { return (lines = fleet().ReadLog(before)).size() >= 2; },
                                  absl::Seconds(10)))
      << fleet().LogTail();
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0]["request"], "mine-1");
  EXPECT_EQ(lines[0]["caller"], "sub:ann@example.org");
  EXPECT_EQ(lines[0]["method"], "/pepeseg.v1.SceneService/ListScenes");
  EXPECT_EQ(lines[0]["scene"], "shelf");
  EXPECT_EQ(lines[0]["server"], "server1");
  EXPECT_EQ(lines[1]["scene"], "\"}{ \\");
  EXPECT_EQ(lines[1]["code"], "16");
  EXPECT_EQ(lines[1]["request"].get<std::string>().size(), 36u);
  EXPECT_EQ(fleet().LogTail().find(token.substr(token.size() - 40)), std::string::npos);
  EXPECT_THAT(fleet().Metrics(), HasSubstr("haproxy_frontend_http_requests_total{proxy=\"grpc\"}"));
}

// Must be the last test, since it restarts the server.
TEST_F(GatewayTest, ReportsThatThereIsNoServer) {
  fleet().KillServer(0);
  const auto start = absl::Now();
  EXPECT_THAT(TextOf(List(Token())), StartsWith("UNAVAILABLE: no server answers the gateway"));
  EXPECT_LT(absl::Now() - start, absl::Seconds(10));
  fleet().StartServer(0);
  EXPECT_TRUE(fleet().AwaitServing(1));
  EXPECT_EQ(TextOf(List(Token())), "OK: ");
}

}  // namespace
}  // namespace pepeseg::testing
