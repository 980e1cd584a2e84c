// What the real client says of a gateway, and of a proxy that is none.
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cstdio>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/gateway/gateway_fixture.h"

namespace pepeseg::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct Ran {
  int exit_code = -1;
  std::string output;
};

class ProgramAtGateway : public GatewayTest {
 protected:
  // `pepeseg` with the token in a file, as a user has it; "": with none.
  static Ran Run(const std::string& token, const std::string& verb) {
    std::string command = absl::StrCat(PEPESEG_PROGRAM " --server https://localhost:",
                                       fleet().gateway_port(), " --ca ",
                                       (fleet().folder / "authority.pem").string(), " ");
    if (!token.empty()) {
      std::ofstream(fleet().folder / "token", std::ios::trunc) << token << "\n";
      absl::StrAppend(&command, "--key-file ", (fleet().folder / "token").string(), " ");
    }
    FILE* pipe = popen((command + verb + " 2>&1").c_str(), "r");
    Ran ran;
    char buffer[4096];
    for (size_t size = 0; (size = fread(buffer, 1, sizeof(buffer), pipe)) > 0;) {
      ran.output.append(buffer, size);
    }
    const int status = pclose(pipe);
    ran.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return ran;
  }
};

TEST_F(ProgramAtGateway, WorksWithAJwtOrAKey) {
  ASSERT_TRUE(CreateScene(Token(), "shelf").ok());
  const Ran by_jwt = Run(Token(), "scenes");
  EXPECT_EQ(by_jwt.exit_code, 0) << by_jwt.output;
  EXPECT_THAT(by_jwt.output, HasSubstr("shelf"));
  const Ran by_key = Run(fleet().MakeKey("lab", {v1::SCOPE_READ}), "scenes");
  EXPECT_EQ(by_key.exit_code, 0) << by_key.output;
  EXPECT_THAT(by_key.output, HasSubstr("shelf"));
}

TEST_F(ProgramAtGateway, SaysInPlainWordsWhatIsWrongWithAToken) {
  const Ran none = Run("", "scenes");
  EXPECT_EQ(none.exit_code, 10);
  EXPECT_THAT(none.output, AllOf(HasSubstr("asks for a key or a token"), HasSubstr("--key-file")));
  const Ran wrong = Run(TokenIssuer().Sign(TokenIssuer::Claims("lab", "read")), "scenes");
  EXPECT_EQ(wrong.exit_code, 10);
  EXPECT_THAT(wrong.output, HasSubstr("not signed by whom the gateway trusts"));
  auto claims = TokenIssuer::Claims("lab", "read");
  claims["exp"] = absl::ToUnixSeconds(absl::Now()) - 1;
  const Ran expired = Run(fleet().issuer.Sign(claims), "scenes");
  EXPECT_EQ(expired.exit_code, 10);
  EXPECT_THAT(expired.output, AllOf(HasSubstr("the token has expired"), HasSubstr("gateway")));
  const Ran wrong_key = Run("pk_" + std::string(43, 'a'), "scenes");
  EXPECT_EQ(wrong_key.exit_code, 10);
  EXPECT_THAT(wrong_key.output, HasSubstr("unknown, revoked or expired"));
}

TEST_F(ProgramAtGateway, SaysThatASceneIsAnotherProjects) {
  const std::string theirs = fleet().issuer.Sign(TokenIssuer::Claims("theirs", "read write"));
  ASSERT_TRUE(CreateScene(theirs, "vase").ok());
  const Ran ran = Run(Token(), "scenes vase");
  EXPECT_EQ(ran.exit_code, 10);
  EXPECT_THAT(ran.output, AllOf(HasSubstr("another project's"), HasSubstr("pepeseg scenes")));
}

TEST_F(ProgramAtGateway, SaysThatTheCallsOfAWindowAreUsedUp) {
  auto claims = TokenIssuer::Claims("lab", "read");
  claims["sub"] = "busy";
  const std::string token = fleet().issuer.Sign(claims);
  const auto channel = fleet().Connect(token);
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(List(channel).ok()) << i;
  const Ran ran = Run(token, "scenes");
  EXPECT_EQ(ran.exit_code, 9);
  EXPECT_THAT(ran.output, AllOf(HasSubstr("more than 100 calls in 3s"), HasSubstr("wait")));
}

TEST_F(ProgramAtGateway, SaysThatTheHeadersAreTooLarge) {
  auto claims = TokenIssuer::Claims("lab", "read");
  claims["groups"] = std::string(9 << 10, 'x');  // as some issuers make them
  const Ran ran = Run(fleet().issuer.Sign(claims), "scenes");
  EXPECT_EQ(ran.exit_code, 9);
  EXPECT_THAT(ran.output, AllOf(HasSubstr("headers"), HasSubstr("8192 bytes")));
}

}  // namespace
}  // namespace pepeseg::testing
