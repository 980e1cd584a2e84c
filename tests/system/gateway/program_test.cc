// Messages of the real client about errors of the gateway, and of another proxy.
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cstdio>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/system/gateway/gateway_fixture.h"
#include "tests/testing/status_testing.h"

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
  // Runs `pepeseg` with the token in a file, as a user does. "": without a token.
  static Ran Run(const std::string& token, const std::string& verb) {
    std::string arguments = absl::StrCat("--server https://localhost:", fleet().gateway_port(),
                                         " --ca ", (fleet().folder / "authority.pem").string());
    if (!token.empty()) {
      std::ofstream(fleet().folder / "token", std::ios::trunc) << token << "\n";
      absl::StrAppend(&arguments, " --key-file ", (fleet().folder / "token").string());
    }
    return RunProgram(absl::StrCat(arguments, " ", verb));
  }
  static Ran RunProgram(const std::string& arguments) {
    FILE* pipe = popen((PEPESEG_PROGRAM " " + arguments + " 2>&1").c_str(), "r");
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
  ASSERT_OK(CreateScene(Token(), "shelf"));
  const Ran by_jwt = Run(Token(), "scenes");
  EXPECT_EQ(by_jwt.exit_code, 0) << by_jwt.output;
  EXPECT_THAT(by_jwt.output, HasSubstr("shelf"));
  const Ran by_key = Run(fleet().MakeKey("lab", {v1::SCOPE_READ}), "scenes");
  EXPECT_EQ(by_key.exit_code, 0) << by_key.output;
  EXPECT_THAT(by_key.output, HasSubstr("shelf"));
}

TEST_F(ProgramAtGateway, ExplainsWhatIsWrongWithAToken) {
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

TEST_F(ProgramAtGateway, ReportsAnotherProjectsScene) {
  const std::string theirs = fleet().issuer.Sign(TokenIssuer::Claims("theirs", "read write"));
  ASSERT_OK(CreateScene(theirs, "vase"));
  const Ran ran = Run(Token(), "scenes vase");
  EXPECT_EQ(ran.exit_code, 10);
  EXPECT_THAT(ran.output, AllOf(HasSubstr("another project's"), HasSubstr("pepeseg scenes")));
}

TEST_F(ProgramAtGateway, ReportsTheRateLimit) {
  auto claims = TokenIssuer::Claims("lab", "read");
  claims["sub"] = "busy";
  const std::string token = fleet().issuer.Sign(claims);
  EXPECT_EQ(ListAtOnce(token, 100), (std::map<std::string, int>{{"OK: ", 100}}));
  const Ran ran = Run(token, "scenes");
  EXPECT_EQ(ran.exit_code, 9);
  EXPECT_THAT(ran.output, AllOf(HasSubstr("more than 100 calls in 2s"), HasSubstr("wait")));
}

TEST_F(ProgramAtGateway, ReportsHeadersThatAreTooLarge) {
  auto claims = TokenIssuer::Claims("lab", "read");
  claims["groups"] = std::string(9 << 10, 'x');  // as large as those of some issuers
  const Ran ran = Run(fleet().issuer.Sign(claims), "scenes");
  EXPECT_EQ(ran.exit_code, 9);
  EXPECT_THAT(ran.output, AllOf(HasSubstr("headers"), HasSubstr("8192 bytes")));
}

// Serves, each on its own port, the answers of HTTP/2 proxies without gRPC and of an HTTP/1 server.
class ProgramAtAProxy : public ProgramAtGateway {
 protected:
  struct Proxy {
    std::string rule;  // HAProxy's configuration
    std::string protocol = "proto h2";
    int port = FreePort();
  };
  void Serve(const std::vector<Proxy>& proxies) {
    std::ofstream configuration(fleet().folder / "proxies.cfg");
    configuration << "defaults\n mode http\n timeout client 5s\n";
    for (const Proxy& proxy : proxies) {
      const char* http1 = proxy.protocol.empty() ? " option disable-h2-upgrade\n" : "";
      configuration << "frontend f" << proxy.port << "\n bind 127.0.0.1:" << proxy.port << " "
                    << proxy.protocol << "\n"
                    << http1 << " http-request " << proxy.rule << "\n";
    }
    configuration.close();
    auto process = WorkerProcess::Launch({kHaproxy,
                                          {"-db", "-f", (fleet().folder / "proxies.cfg").string()},
                                          fleet().folder / "proxies.log"});
    ASSERT_OK(process);
    process_ = std::move(process).value();
    absl::SleepFor(absl::Milliseconds(500));
    ASSERT_FALSE(process_->Poll().has_value())
        << ReadFileTail(fleet().folder / "proxies.log", 2000);
  }
  static Ran Ask(const Proxy& proxy) {
    return RunProgram(absl::StrCat("--server 127.0.0.1:", proxy.port, " scenes"));
  }

 private:
  std::unique_ptr<WorkerProcess> process_;
};

TEST_F(ProgramAtAProxy, ExplainsTheProxysAnswer) {
  const std::string html = " content-type text/html string '<html>no</html>'";
  const std::vector<std::pair<Proxy, int>> answers = {
      {{"return status 502" + html}, 5},  {{"return status 503" + html}, 5},
      {{"return status 431" + html}, 9},  {{"return status 429" + html}, 9},
      {{"return status 403" + html}, 10}, {{"return status 404" + html}, 5},
      {{"return status 200" + html}, 5}};
  std::vector<Proxy> proxies;
  for (const auto& [proxy, exit_code] : answers) proxies.push_back(proxy);
  const Proxy http1{"return status 200" + html, ""};
  proxies.push_back(http1);
  Serve(proxies);
  for (const auto& [proxy, exit_code] : answers) {
    const Ran ran = Ask(proxy);
    EXPECT_EQ(ran.exit_code, exit_code) << proxy.rule << "\n" << ran.output;
    EXPECT_THAT(ran.output, AllOf(HasSubstr("proxy"), Not(HasSubstr("http2 header"))))
        << proxy.rule;
  }
  const Ran ran = Ask(http1);
  EXPECT_EQ(ran.exit_code, 5) << ran.output;
}

}  // namespace
}  // namespace pepeseg::testing
