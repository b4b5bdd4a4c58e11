// A hospital's sign-on: the certified oidc-provider with its own pages, on loopback. Beside it a strict fake of its
// health record, by SMART App Launch 2.2.0: nobody publishes a server of that as a package. It opens pat.1 by a launch
// that it has begun (/ehr/launch), refuses one without `aud`, and shows a patient to an access token alone.
// Arguments: port, GARRY's address, a JSON file {name: {groups: [...]}} of who works there now.
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import Provider, { errors } from "oidc-provider";

const [port, garry, staff] = process.argv.slice(2);
const issuer = `http://localhost:${port}`;
const fhir = `${issuer}/fhir`;
const launches = new Map(); // what was launched, then the PKCE challenge that it was asked with: the open patient
const provider = new Provider(issuer, {
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
    scopes: ["openid", "profile", "launch", "patient/Patient.read"],
    extraParams: {
        launch(context, launch) {
            if (launch === undefined) return;
            const { aud, code_challenge } = context.oidc.params;
            if (aud !== fhir || !launches.has(launch)) throw new errors.InvalidRequest("an unknown launch, or aud");
            launches.set(code_challenge, launches.get(launch));
        },
        aud: null,
    },
    pkce: { required: () => true },
    cookies: { keys: ["of this test"] },
    async findAccount(_context, sub) {
        const known = JSON.parse(readFileSync(staff, "utf-8"))[sub];
        return known && { accountId: sub, claims: () => ({ sub, preferred_username: sub, given_name: sub, ...known }) };
    },
});
provider.use(async (context, next) => {
    if (context.path === "/ehr/launch") {
        launches.set("of-this-click", "pat.1");
        const asked = new URLSearchParams({ iss: context.query.iss ?? fhir, launch: "of-this-click" });
        context.redirect(`${garry}/launch/?${asked}`);
    } else if (context.path === "/fhir/.well-known/smart-configuration") {
        context.body = {
            issuer,
            jwks_uri: `${issuer}/jwks`,
            authorization_endpoint: `${issuer}/auth`,
            token_endpoint: `${issuer}/token`,
            grant_types_supported: ["authorization_code"],
            code_challenge_methods_supported: ["S256"],
            capabilities: ["launch-ehr", "client-confidential-symmetric", "sso-openid-connect", "context-ehr-patient"],
        };
    } else if (context.path.startsWith("/fhir/Patient/")) {
        const token = await provider.AccessToken.find((context.get("authorization") || "").replace("Bearer ", ""));
        if (!token?.scope.split(" ").includes("patient/Patient.read")) context.throw(401);
        const number = readFileSync(`${staff}.number`, "utf-8");
        const identifier = [
            { system: "urn:elsewhere", value: "0" },
            { system: "urn:city-hospital:mrn", value: number },
        ];
        context.body = { resourceType: "Patient", id: context.path.split("/").pop(), identifier };
        context.type = "application/fhir+json";
    } else {
        await next();
        if (context.path === "/token" && context.status === 200) {
            const challenge = createHash("sha256").update(context.oidc.params.code_verifier).digest("base64url");
            if (launches.has(challenge)) context.body = { ...context.body, patient: launches.get(challenge) };
        }
    }
});
provider.listen(Number(port), "localhost", () => console.log("ready"));
