#!/usr/bin/env bash
# Destroying an idle prometheus::Exposer blocks for up to two seconds, unless somebody connects to it.
#
# prometheus-cpp 1.0.1 on CivetWeb 1.15, as packaged by Debian 12. The exposer's destructor sets a flag
# and waits for the thread that accepts connections. That thread sits in poll() for two seconds at a
# time, and nothing wakes it but a connection. One would expect a stop to take milliseconds: an
# exposer that is destroyed right after it was made does stop at once, because its thread is not in
# poll() yet, so a short test of one's own shows nothing.
#
# Seen (seconds): idle for 0.3 s, then destroyed: 1.70 1.70 1.70. Destroyed at once: 0.01. Idle for
# 0.3 s and visited by one connection after the destructor began: 0.06.
#
# Needs Debian 12's apt, a C++ compiler and about 3 MB. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -qq prometheus-cpp-dev=1.0.1-1 libprometheus-cpp-core1.0=1.0.1-1 \
  libprometheus-cpp-pull1.0=1.0.1-1 libcivetweb1=1.15+dfsg-4
for package in *.deb; do dpkg-deb -x "$package" .; done
libraries=$(dirname "$(find "$folder/usr/lib" -name 'libcivetweb.so.1')")

cat > stop.cc <<'SOURCE'
#include <arpa/inet.h>
#include <prometheus/exposer.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <thread>

// Returns the seconds that the destructor takes after `idle_ms`; with a visit, somebody connects
// 50 ms after it began.
double Stop(int idle_ms, bool visit) {
  auto exposer = std::make_unique<prometheus::Exposer>("127.0.0.1:0", 1);
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(exposer->GetListeningPorts().front()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::this_thread::sleep_for(std::chrono::milliseconds(idle_ms));
  std::thread visitor([&] {
    if (!visit) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    const int connection = socket(AF_INET, SOCK_STREAM, 0);
    (void)connect(connection, reinterpret_cast<sockaddr*>(&address), sizeof(address));
    close(connection);
  });
  const auto start = std::chrono::steady_clock::now();
  exposer.reset();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  visitor.join();
  return seconds;
}

int main() {
  bool as_seen = true;
  for (int run = 0; run < 3; ++run) {
    const double idle = Stop(300, false), visited = Stop(300, true);
    std::printf("idle %.2f s, visited %.2f s\n", idle, visited);
    as_seen = as_seen && idle > 1.2 && idle < 2.5 && visited < 0.8;
  }
  std::printf("destroyed at once %.2f s\n", Stop(0, false));
  return as_seen ? 0 : 1;
}
SOURCE
g++ -std=c++17 -I"$folder/usr/include" stop.cc -o stop -L"$libraries" -l:libprometheus-cpp-pull.so.1.0 \
  -l:libprometheus-cpp-core.so.1.0 -Wl,--allow-shlib-undefined -pthread
LD_LIBRARY_PATH=$libraries ./stop || { echo 'the behaviour has changed'; exit 1; }
echo 'as described'
