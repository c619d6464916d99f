using Handcal;
using UnityEngine;

/// <summary>
/// Opens the system's keyboard while the headset is not paired, for the PC's address and digits
/// ("192.168.1.20 12345678") or the text under its QR code, until one of them pairs it.
/// </summary>
public sealed class PairByTyping : MonoBehaviour
{
    const float AgainS = 3;  // to read what was wrong
    public HandcalHeadset headset;
    TouchScreenKeyboard keyboard;
    string typed = "";
    float askAtS;

    /// <summary>Opens the keyboard, also to pair again: call it from a button.</summary>
    public void Ask()
    {
        if (TouchScreenKeyboard.isSupported) keyboard = TouchScreenKeyboard.Open(typed);
        askAtS = float.PositiveInfinity;  // the Editor has none
    }

    void Update()
    {
        if (keyboard != null && keyboard.status != TouchScreenKeyboard.Status.Visible)
        {
            if (keyboard.status == TouchScreenKeyboard.Status.Done) headset.Pair(typed = keyboard.text);
            keyboard = null;
            askAtS = Time.realtimeSinceStartup + AgainS;
        }
        if (keyboard == null && !headset.IsPaired && !headset.IsPairing && Time.realtimeSinceStartup >= askAtS) Ask();
    }
}
