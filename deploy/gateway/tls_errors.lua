-- HAProxy before 3.0.4 (and Debian's 2.6.12) leaves OpenSSL's errors of a token whose signature is
-- wrong where the next connection that reads nothing takes them for its own and ends: anybody could
-- break others' calls with a forged token (github.com/haproxy/haproxy/issues/2643). luaossl takes all
-- errors of the thread away when a function of its own fails; so one is made to.
local key = require('openssl.pkey')

core.register_action('drop_tls_errors', {'http-req'}, function()
  pcall(key.new, 'no key')
end)
