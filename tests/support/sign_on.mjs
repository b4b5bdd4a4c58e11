// A hospital's sign-on: the certified oidc-provider with its own pages, on loopback.
// Arguments: port, GARRY's address, a JSON file {name: {groups: [...]}} of who works there now.
import { readFileSync } from "node:fs";
import Provider from "oidc-provider";

const [port, garry, staff] = process.argv.slice(2);
const provider = new Provider(`http://localhost:${port}`, {
    clients: [
        {
            client_id: "garry",
            client_secret: "a secret between the two of them, of this test",
            redirect_uris: [`${garry}/sign-in/hospital/back/`],
            post_logout_redirect_uris: [`${garry}/sign-in/`],
            backchannel_logout_uri: `${garry}/sign-in/hospital/ended/`,
        },
    ],
    claims: { openid: ["sub"], profile: ["preferred_username", "given_name", "groups"] },
    features: { backchannelLogout: { enabled: true }, devInteractions: { enabled: true } },
    fetch: (url, { dispatcher, ...options }) => fetch(url, options), // its own refuses loopback
    pkce: { required: () => true },
    cookies: { keys: ["of this test"] },
    async findAccount(_context, sub) {
        const known = JSON.parse(readFileSync(staff, "utf-8"))[sub];
        return known && { accountId: sub, claims: () => ({ sub, preferred_username: sub, given_name: sub, ...known }) };
    },
});
provider.listen(Number(port), "localhost", () => console.log("ready"));
