"""URLs of the front page, the sign-in, the own account and consent."""

from django.urls import path

from rehab.people.pages import account, confirm, consent, home, second_factor, sign_in, sign_on

urlpatterns = [
    path("", home.home, name="home"),
    path("js/<str:language>/catalog.js", home.show_catalog, name="catalog"),
    path("sign-in/", sign_in.sign_in, name="sign-in"),
    path("sign-in/code/", sign_in.verify_second_factor, name="second-factor"),
    path("sign-in/hospital/", sign_on.begin, name="sign-on"),
    path("sign-in/hospital/back/", sign_on.complete, name="sign-on-complete"),
    path("sign-in/hospital/ended/", sign_on.end, name="sign-on-ended"),
    path("launch/", sign_on.launch, name="launch"),
    path("account/confirm/hospital/", sign_on.confirm, name="sign-on-confirm"),
    path("account/hospital/", sign_on.link, name="sign-on-link"),
    path("sign-out/", sign_in.sign_out, name="sign-out"),
    path("help/", home.show_help, name="help"),
    path("help/<slug:page>/", home.show_help, name="help-page"),
    path("account/", account.show_account, name="account"),
    path("account/sign-ins/", account.show_sign_ins, name="own-sign-ins"),
    path("account/sign-ins/end/", account.end_sign_ins, name="end-sign-ins"),
    path("account/language/", account.choose_language, name="own-language"),
    path("account/confirm/", confirm.confirm, name="confirm"),
    path("account/resets/", account.confirm_reset, name="confirm-reset"),
    path("account/password/", account.change_password, name="own-password"),
    path("account/second-factor/", second_factor.choose_factor, name="set-up-second-factor"),
    path("account/second-factor/app/", second_factor.add_app, name="add-app"),
    path("account/second-factor/passkey/", second_factor.add_passkey, name="add-passkey"),
    path(
        "account/second-factor/remove/",
        second_factor.remove_authenticator,
        name="remove-authenticator",
    ),
    path("patients/<int:patient_id>/consent/", consent.show_consent, name="consent"),
    path("consent/words/", consent.edit_consent_text, name="consent-text"),
    path("account/recovery-codes/", second_factor.renew_codes, name="recovery-codes"),
]
