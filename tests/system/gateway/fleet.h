#pragma once

#include <grpcpp/grpcpp.h>

#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/base/file_io.h"
#include "pepeseg/v1/access.pb.h"
#include "server/jobs/launcher.h"
#include "tests/server/access/test_certificates.h"
#include "tests/server/pepesegd_process.h"
#include "tests/system/gateway/token_issuer.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::testing {

inline constexpr char kHaproxy[] = "/usr/sbin/haproxy";

// Returns a port on which nothing listens now.
int FreePort();

// Returns whether this machine has what deploy/gateway/haproxy.cfg needs.
bool HasHaproxy();

struct FleetOptions {
  int num_servers = 1;
  std::string database;                          // URL; empty: SQLite, for one server
  std::filesystem::path data;                    // empty: in the fleet's folder
  std::filesystem::path worker;                  // empty: pepeseg-worker
  std::vector<std::string> server_arguments;     // in addition to the usual ones
  std::vector<std::string> gateway_environment;  // "NAME=VALUE"; overrides the fleet's variables
};

// HAProxy with deploy/gateway/haproxy.cfg, and servers behind it that trust its certificate. All
// listen on ports of this machine. The destructor kills them.
class Fleet {
 public:
  explicit Fleet(const FleetOptions& options);

  // Start, stop or kill server `i`, from 0. It keeps its port.
  void StartServer(int i);
  std::optional<WorkerEnd> StopServer(int i);  // sends SIGTERM, returns how it ended
  void KillServer(int i) { servers_[i].reset(); }
  PepesegdProcess& server(int i) { return *servers_[i]; }
  // Ends the gateway and starts it with this number of servers.
  void RestartGateway(int num_servers);
  WorkerProcess& gateway() { return *gateway_; }
  int gateway_port() const { return gateway_port_; }
  // Waits up to 20 s until this number of servers serve, as seen by the gateway.
  bool AwaitServing(int num_servers) const;
  int CountServing() const;
  std::string Metrics() const;

  // Returns a channel with its own connection to the gateway, or directly to server `i`. `token`: a
  // key or a JWT, sent with each call; empty: none.
  std::shared_ptr<grpc::Channel> Connect(const std::string& token) const;
  std::shared_ptr<grpc::Channel> ConnectDirectly(int i, const std::string& token) const;
  // Returns a channel to a server with another certificate than the gateway's.
  std::shared_ptr<grpc::Channel> ConnectDirectly(int i, const std::string& token,
                                                 const IssuedCertificate& own) const;
  // Creates an API key of the servers, and returns its secret.
  std::string MakeKey(const std::string& project, const std::vector<v1::Scope>& scopes) const;

  // Returns the gateway's log since its start, from `offset` on: one object per line. Leaves out
  // lines that are not JSON.
  std::vector<nlohmann::json> ReadLog(size_t offset = 0) const;
  size_t LogSize() const;
  std::string LogTail() const { return ReadFileTail(log_, 3000); }
  std::string ReadAudit() const;

  const TokenIssuer issuer, next_issuer;  // the gateway trusts both
  TestAuthority authority{"authority"}, clients{"of clients"};
  const TempFolder folder;

 private:
  void WriteFiles();
  std::string Database() const;

  const FleetOptions options_;
  const std::filesystem::path data_;
  int num_starts_ = 0;
  std::filesystem::path log_;  // log of the running gateway
  IssuedCertificate of_gateway_;
  std::vector<int> ports_;
  std::vector<std::unique_ptr<PepesegdProcess>> servers_;
  std::unique_ptr<WorkerProcess> gateway_;
  int gateway_port_ = 0, metrics_port_ = 0;
};

}  // namespace pepeseg::testing
