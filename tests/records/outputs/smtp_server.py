"""A mail server that is not ours (aiosmtpd), for the tests of mails.

python3 smtp_server.py PORT FILE [--tls implicit|starttls CERTIFICATE KEY] [--password USER PASSWORD] [--first WORD,WORD]

Each mail that is taken is a line of JSON in FILE: sender, recipients, text as it came, body in letters, whether over TLS, and who had signed in. WORD is what happens
to the first mails: `451` and other codes refuse the text, `hangup` takes it and closes the line without an answer. The recipients
`nobody@...` do not exist. Ends with its standard input.
"""

import argparse
import email
import json
import ssl
import sys

from aiosmtpd.controller import Controller
from aiosmtpd.smtp import SMTP, AuthResult


class Handler:
    def __init__(self, file, first):
        self.file, self.first = file, first

    async def handle_RCPT(self, server, session, envelope, address, options):
        if address.startswith("nobody@"):
            return "550 5.1.1 no such mailbox"
        envelope.rcpt_tos.append(address)
        return "250 OK"

    async def handle_DATA(self, server, session, envelope):
        word = self.first.pop(0) if self.first else None
        if word and word != "hangup":
            return f"{word} as the test wants it"
        mail = {
            "from": envelope.mail_from,
            "to": envelope.rcpt_tos,
            "text": envelope.content.decode("ascii"),
            "body": email.message_from_bytes(envelope.content).get_payload(decode=True).decode("utf-8"),
            "tls": session.ssl is not None or server.tls_implicit,
            "user": session.auth_data,
        }
        with open(self.file, "a", encoding="utf-8") as file:
            file.write(json.dumps(mail) + "\n")
        if word == "hangup":
            server.transport.abort()
        return "250 OK"


class Server(SMTP):
    tls_implicit = False


class MailServer(Controller):
    def __init__(self, handler, implicit, **keywords):
        self.implicit = implicit
        super().__init__(handler, ssl_context=implicit, **keywords)

    def factory(self):
        server = Server(self.handler, **self.SMTP_kwargs)
        server.tls_implicit = self.implicit is not None
        return server


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("port", type=int)
    parser.add_argument("file")
    parser.add_argument("--tls", nargs=3)
    parser.add_argument("--password", nargs=2)
    parser.add_argument("--first", default="")
    given = parser.parse_args()
    keywords, implicit = {}, None
    if given.tls:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(given.tls[1], given.tls[2])
        if given.tls[0] == "implicit":
            implicit = context
        else:
            keywords |= {"tls_context": context, "require_starttls": True}
    if given.password:
        expected = tuple(given.password)

        def authenticate(server, session, envelope, mechanism, data):
            is_right = (data.login.decode(), data.password.decode()) == expected
            return AuthResult(success=is_right, handled=is_right, auth_data=data.login.decode())

        keywords |= {"authenticator": authenticate, "auth_required": True, "auth_require_tls": implicit is None}
    handler = Handler(given.file, [word for word in given.first.split(",") if word])
    server = MailServer(handler, implicit, hostname="127.0.0.1", port=given.port, **keywords)
    server.start()
    print("ready", flush=True)
    sys.stdin.read()
    server.stop()


main()
